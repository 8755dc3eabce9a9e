"""What gaps leave of a log, and whether what is advised can be read."""

import numpy as np
import pytest

from pivident.data.logs import timestamps
from pivident.data.logs.clock_alignment import ClockedChannel, onto_one_clock
from pivident.data.logs.timestamps import stretches, stretches_of
from pivident.foundation.errors import GapInClock, MissingSamples


def holed(rate, *holes, start=0.0, samples=3000):
    return np.delete(start + np.arange(samples) / rate, np.r_[*(np.s_[a:b] for a, b in holes)])


@pytest.mark.parametrize("rate", [100.0, 125.3, 500.0, 1000.0, 5000.0])
@pytest.mark.parametrize("start", [0.0, 0.1234567, 36012.0371])
def test_parts_hold_the_stretches_and_no_gap(rate, start):
    t = holed(rate, (800, 900), (2000, 2300), start=start)
    left = stretches(t)
    assert len(left.parts) == 3 and not left.resample
    for (low, high), inside in zip(left.parts, [800, 1100, 700], strict=True):
        kept = t[(t >= low) & (t <= high)]
        assert inside - 2 * max(1, 0.001 * rate) <= len(kept) <= inside
        assert timestamps.rate_of(kept) == pytest.approx(rate, rel=1e-5)
        values = np.sin(kept)[:, None]
        channel = ClockedChannel("q", "t", t, np.sin(t)[:, None])
        aligned = onto_one_clock([channel], part=(low, high))  # a gap in it would be refused
        assert abs(len(aligned.t) - len(values)) <= 1


def test_what_gaps_cost_is_told():
    left = stretches(holed(1000.0, (1000, 1500), (1510, 2000)))
    assert left.parts == ((0.0, 0.999), (2.0, 2.999))
    assert left.seconds == pytest.approx(2.999)
    assert left.lost == pytest.approx(0.992) and left.short == pytest.approx(0.009)
    text = left.advice()
    assert "one table [[recording]] for both: part = [0.0, 0.999], part = [2.0, 2.999]" in text
    assert "0.992 s are lost" in text and "0.009 s in stretches too short" in text
    assert "resample" not in text


def test_short_gaps_are_filled_and_long_ones_are_not():
    left = stretches(holed(1000.0, (500, 502), (1000, 1500)))
    assert left.resample and len(left.parts) == 2
    assert left.advice().endswith("set resample = true too, which fills the shorter gaps")
    short = stretches(holed(1000.0, (500, 502)))
    assert short.advice() == "set resample = true, which fills gaps as short as these"


def test_of_many_stretches_the_longest_are_listed():
    between = [(10.0 * k, 10.0 * k + 5 + 0.1 * k) for k in range(9)]
    text = stretches_of(between, 1e-3, resample=False).advice()
    assert "for the 6 longest: part = [30.0, 35.3]" in text and text.count("part = ") == 7


def test_a_pause_of_any_length_is_a_gap_and_no_jitter():
    t = np.arange(2000) / 500.0
    t[1200:] += 0.7503  # not a whole number of periods
    with pytest.raises(MissingSamples, match=r"part = \[0\.0, 2\.398\]"):
        timestamps.rate_of(t)
    with pytest.raises(GapInClock, match=r"write part = \[0\.0, 2\.398\]"):
        onto_one_clock([ClockedChannel("q", "t", t, np.sin(t)[:, None])])
