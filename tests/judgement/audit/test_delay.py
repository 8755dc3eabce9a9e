"""How long a delay has to be before anything is done about it, and which timing explains it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pivident.judgement.audit.audit import audit_log
from pivident.judgement.audit.delay import undeclared_timing
from tests.judgement.audit.logs import clean_log, delayed, planar, with_channels


@pytest.mark.parametrize(
    ("late", "severity", "repaired"),
    [
        (0.05, "ok", []),
        (0.2, "warning", ["delay"]),
        (0.45, "warning", ["delay", "torque_timing"]),
        (10.0, "error", ["delay"]),
    ],
)
def test_only_a_long_delay_is_made_good(late, severity, repaired):
    """Delays in samples of 1 ms, with a standard error of 0.02: what is short moves no row."""
    log = replace(planar(), torque_timing="held")
    tau = np.column_stack([delayed(x, late) for x in log.channels["tau"].T])
    audit = audit_log(with_channels(log, tau=tau))
    (finding,) = (f for f in audit.of("delay") if not f.subject)
    assert finding.severity == severity
    assert [repair.edits[0].place[-1] for repair in finding.repairs] == repaired
    mean, error = (1e3 * x for x in audit.delay.common)
    assert mean == pytest.approx(late, abs=0.05)
    assert finding.quantity.interval == pytest.approx((mean - 2.0 * error, mean + 2.0 * error))
    size, spread = re.search(r"is (\S+) ± (\S+) ms", finding.message).groups()
    assert (float(size), float(spread)) == pytest.approx((abs(mean), 2.0 * error), abs=5e-4)
    made_good = mean if severity == "error" else 0.0
    assert audit.model.shift == pytest.approx(0.5 - made_good, abs=1e-3)


@pytest.mark.parametrize(("late", "timing"), [(0.785, "sampled"), (0.795, "averaged")])
def test_of_two_instants_that_are_as_likely_the_usual_one_is_taken(late, timing):
    """A value is 1/2 sample late, a mean 1: |d - 1/2| - |d - 1| = 2σ at d = 3/4 + σ."""
    log = clean_log("planar_2r", 1, 10.0)
    assert undeclared_timing(log, 1000.0, (1e-3 * late, 4e-5)) == timing
