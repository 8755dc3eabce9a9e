"""Drives that answer late: the simulated loop against laws that wait, and the oracle."""

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.controllers import PD, PythonController
from tests.judgement.validation import one_axis
from tests.loop.simulation.loops import (
    TX40_KD,
    TX40_KP,
    nominal_model,
    relative_rms,
    reversals,
    run,
    signals_of,
)

RATE = 1000.0
KP, KD = np.array([900.0, 300.0]), np.array([60.0, 20.0])


class WaitingPD:
    """A PD law whose answer leaves so many samples later."""

    def __init__(self, samples):
        self.samples, self.last, self.queue = samples, None, None

    def __call__(self, k, q, q_ref, dq_ref):
        last = q if self.last is None else self.last
        self.last = q
        u = KP * (q_ref - q) + KD * (dq_ref - (q - last) * RATE)
        if self.queue is None:
            self.queue = [u] * self.samples
        self.queue.append(u)
        return self.queue.pop(0)


@pytest.mark.parametrize("samples", [1, 2])
def test_whole_periods_are_a_law_that_waits(samples):
    arm, motion = nominal_model("planar_2r"), reversals(500, RATE, [0.4, 0.6], [1.0, 1.5])
    late = run(*arm, PD(KP, KD), signals_of(RATE, *motion, drive_delay=samples / RATE))
    waiting = run(*arm, PythonController(WaitingPD(samples)), signals_of(RATE, *motion))
    for channel in ("q", "dq", "ddq", "tau"):
        ours, theirs = getattr(late, channel), getattr(waiting, channel)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-11 * abs(theirs).max())
    # the law's own answers are known at once
    np.testing.assert_allclose(late.command[:-samples], late.tau[samples:], atol=1e-12)


def test_parts_of_a_period_agree_with_the_oracle():
    arm = nominal_model("staubli_tx40")
    q_ref, dq_ref = reversals(1500, 5000.0, [0.3] * 6, [0.9, 1.1, 1.3, 1.7, 1.9, 2.3])
    signals = signals_of(5000.0, q_ref, dq_ref, drive_delay=0.3 / 5000.0)
    controller = PD(TX40_KP, TX40_KD)
    fast = run(*arm, controller, signals)
    exact = run(*arm, controller, signals, oracle=64)
    assert relative_rms(fast.ddq, exact.ddq).max() < 1e-4


def test_python_laws_wait_as_compiled_ones():
    arm, motion = nominal_model("planar_2r"), reversals(300, RATE, [0.4, 0.6], [1.0, 1.5])
    signals = signals_of(RATE, *motion, drive_delay=1.4 / RATE)
    compiled = run(*arm, PD(KP, KD), signals)
    python = run(*arm, PythonController(WaitingPD(0)), signals)
    np.testing.assert_allclose(python.q, compiled.q, rtol=0, atol=1e-12)


@pytest.mark.parametrize("delay", [-1e-3, np.nan, 5.0])
def test_delays_that_cannot_be_are_refused(delay):
    arm, motion = nominal_model("planar_2r"), reversals(300, RATE, [0.4, 0.6], [1.0, 1.5])
    with pytest.raises(ExperimentError, match="drive_delay is"):
        run(*arm, PD(KP, KD), signals_of(RATE, *motion, drive_delay=delay))


def test_a_declared_delay_gives_the_parameters_back():
    delay = 0.4 / one_axis.RATE
    made = one_axis.motion(delay=delay)
    rng = np.random.default_rng(1)

    def estimate(declared):
        q_ref, dq_ref, ddq_ref = one_axis.reference(len(made.q))
        record = Recording(
            "axis", ("carriage",), made.q, made.command + 0.2 * rng.normal(size=made.q.shape),
            one_axis.RATE, q_ref, dq_ref, ddq_ref, drive_delay=declared,
        )  # fmt: skip
        found = identify(one_axis.problem(record), InstrumentalVariables(RandomWalk()))
        truth = np.array([one_axis.TRUTH[p.name] for p in found.parameters])
        return (found.theta - truth) / truth

    known, ignored = estimate(delay), estimate(0.0)
    assert abs(known[:2]).max() < 5e-3  # mass and viscous friction
    assert abs(ignored[1]) > 10 * abs(known[1])
