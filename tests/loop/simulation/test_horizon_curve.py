"""Runs and errors of benchmarks/horizon_curve.py."""

from itertools import pairwise

import numpy as np
import pytest
from benchmarks.horizon_curve import beginnings, curve, drawn, edges, point


def test_runs_fill_the_record_and_none_is_longer_than_the_horizon():
    runs = list(edges(1037, 100))
    assert runs[0].start == 0 and runs[-1].stop == 1037
    assert all(a.stop == b.start for a, b in pairwise(runs))
    assert max(own.stop - own.start for own in runs) <= 100
    assert list(edges(1037, 1037)) == [(0, 1037)]


def test_the_error_of_a_horizon_counts_samples_not_runs():
    own = point(1.0, [np.full((30, 2), 3.0), np.full((10, 2), 1.0)])
    assert own.error == pytest.approx(np.sqrt((30 * 9.0 + 10 * 1.0) / 40))
    assert (own.low, own.high, own.runs) == (1.0, 3.0, 2)


def test_a_run_that_diverges_makes_its_horizon_infinite():
    own = point(1.0, [np.ones((5, 1)), np.full((5, 1), np.inf)])
    assert own.error == np.inf and own.low == 1.0


def test_an_error_that_grows_with_time_grows_with_the_horizon(tmp_path):
    """e = t from the beginning: its rms up to h is h/√3; the last horizon is the record."""
    rate, seconds = 1000.0, 3.0
    runs = beginnings([np.arange(3000)[:, None] / rate], rate)
    made = curve("drift", "from the beginning", "mm", seconds, runs)
    assert [own.horizon for own in made.points] == [0.1, 0.2, 0.5, 1.0, 2.0, 3.0]
    for own in made.points:
        assert own.error == pytest.approx(own.horizon / np.sqrt(3.0), rel=0.02)
    drawn([made], tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 5000
