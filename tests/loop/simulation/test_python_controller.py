"""Control laws given as Python functions: the same loop, to the last digits."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pivident.foundation.errors import ExperimentError, SimulationDiverged
from pivident.loop.simulation.controllers import PD, PythonController
from tests.loop.simulation.loops import (
    CHANNELS,
    nominal_model,
    relative_rms,
    reversals,
    run,
    signals_of,
)

RATE = 1000.0
KP, KD = np.array([900.0, 300.0]), np.array([60.0, 20.0])


class PythonPD:
    """A PD law that remembers the position it saw last."""

    def __init__(self):
        self.last = None

    def forget(self):
        self.last = None

    def __call__(self, k, q, q_ref, dq_ref):
        last = q if self.last is None else self.last
        self.last = q
        return KP * (q_ref - q) + KD * (dq_ref - (q - last) * RATE)


def python_pd():
    law = PythonPD()
    return PythonController(law, reset=law.forget)


@pytest.fixture(scope="module")
def arm():
    return nominal_model("planar_2r")


@pytest.fixture(scope="module")
def motion():
    return reversals(600, RATE, [0.4, 0.6], [1.0, 1.5])


@pytest.mark.parametrize("oracle", [None, 3])
def test_it_equals_the_compiled_law(arm, motion, oracle):
    inputs = 3.0 * np.sin(np.arange(1200.0)).reshape(600, 2)
    noise = 1e-5 * np.random.default_rng(0).standard_normal((600, 2))
    noise[0] = 0.0
    signals = signals_of(
        RATE, *motion, inputs=inputs, noise=noise, limit=np.array([40.0, 12.0]),
        drive_gain=np.array([1.0, 0.9]),
    )  # fmt: skip
    python = run(*arm, python_pd(), signals, oracle=oracle)
    compiled = run(*arm, PD(KP, KD), signals, oracle=oracle)
    assert (abs(compiled.command) == [40.0, 12.0]).any()
    for channel in CHANNELS:
        ours, theirs = getattr(python, channel), getattr(compiled, channel)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * abs(theirs).max())


def test_differences_of_the_reference_stand_for_its_missing_speed(arm, motion):
    signals = signals_of(RATE, motion[0])
    python, compiled = (run(*arm, law, signals) for law in (python_pd(), PD(KP, KD)))
    np.testing.assert_allclose(python.q, compiled.q, rtol=0, atol=1e-12)


def test_a_law_is_reset_before_each_run(arm, motion):
    controller = python_pd()
    one, two = (run(*arm, controller, signals_of(RATE, *motion)) for _ in range(2))
    np.testing.assert_array_equal(one.tau, two.tau)


def test_runs_in_parallel_do_not_share_the_state_of_a_law(arm, motion):
    controller = python_pd()
    alone = run(*arm, controller, signals_of(RATE, *motion))
    together = threading.Barrier(2)

    def simulate(_):
        together.wait()
        return run(*arm, controller, signals_of(RATE, *motion))

    with ThreadPoolExecutor(2) as pool:
        for made in pool.map(simulate, range(2)):
            np.testing.assert_array_equal(made.q, alone.q)


def test_a_law_that_no_compiled_one_can_be(arm, motion):
    def switching(k, q, q_ref, dq_ref):
        return 30.0 * np.tanh(40.0 * (q_ref - q)) + 0.05 * KD * dq_ref

    law = PythonController(switching)
    made = run(*arm, law, signals_of(RATE, *motion))
    again = run(*arm, law, signals_of(RATE, *motion), oracle=16)
    assert relative_rms(made.q, again.q).max() < 1e-3
    feed_forward = 0.05 * KD * abs(motion[1]).max(axis=0)
    assert (abs(made.command).max(axis=0) <= 30.0 + feed_forward).all()


def test_the_wrong_sign_is_found_with_joint_and_time(arm, motion):
    law = PythonController(lambda k, q, q_ref, dq_ref: -KP * (q_ref - q))
    with pytest.raises(SimulationDiverged) as caught:
        run(*arm, law, signals_of(RATE, *motion, bound=np.array([0.5, 0.5])))
    assert caught.value.joint in arm[0].joint_names
    assert 0.0 < caught.value.time < 0.6


@pytest.mark.parametrize("answer", [1.0, np.zeros(3), [np.nan, 0.0], [np.inf, 0.0]])
def test_an_answer_that_is_no_command_is_refused(arm, motion, answer):
    law = PythonController(lambda k, q, q_ref, dq_ref: np.zeros(2) if k < 7 else answer)
    with pytest.raises(ExperimentError, match="at sample 7; it must return 2 finite numbers"):
        run(*arm, law, signals_of(RATE, *motion))


def test_a_law_cannot_change_the_reference_or_the_robot(arm, motion):
    def careless(k, q, q_ref, dq_ref):
        u = KP * (q_ref - q) + 0.1 * KD * dq_ref
        q[:] = 1e9
        return u

    made = run(*arm, PythonController(careless), signals_of(RATE, *motion))
    assert np.isfinite(made.q).all()

    def worse(k, q, q_ref, dq_ref):
        q_ref -= q
        return KP * q_ref

    with pytest.raises(ValueError, match="read-only"):
        run(*arm, PythonController(worse), signals_of(RATE, *motion))
