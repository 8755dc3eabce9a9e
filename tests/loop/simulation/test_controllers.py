"""The sampled laws against their difference equations in plain Python, and their inverses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import freqz, lfilter

from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.controllers import (
    PD,
    PID,
    TAPS,
    Cascade,
    PythonController,
    backward_difference,
    inverse_controller,
)
from tests.loop.simulation.loops import command_of, nominal_model, reversals, run, signals_of

RATE = 1000.0
LAWS = {
    "PD": PD([900.0], [20.0]),
    "PD with filter": PD([900.0], [20.0], derivative_time=0.004),
    "PD that damps the speed": PD([900.0], [20.0], speed_feed_forward=0.0),
    "PID": PID([900.0], [20.0], [4000.0]),
    "PID with filter": PID([900.0], [20.0], [4000.0], derivative_time=0.002),
    "P": PD([900.0], [0.0]),
    "cascade": Cascade([30.0], [80.0]),
    "cascade with integrator": Cascade([30.0], [80.0], [50.0]),
    "averaged cascade": Cascade([160.18], [243.45], averaged=True),
    "cascade with feed-forward": Cascade([30.0], [80.0], [50.0], speed_feed_forward=0.9),
}


@pytest.fixture(scope="module")
def carriage():
    return nominal_model("emps")


@pytest.fixture(scope="module")
def motion():
    q_ref, dq_ref = reversals(500, RATE, [0.05], [3.0])
    return q_ref, dq_ref


def signals_in_volts(q_ref, dq_ref=None, **changes):
    return signals_of(RATE, q_ref, dq_ref, drive_gain=np.array([35.15]), **changes)


@pytest.mark.parametrize("limit", [np.inf, 3.0])
@pytest.mark.parametrize("with_speed", [True, False])
@pytest.mark.parametrize("name", LAWS)
def test_commands_follow_the_difference_equation(carriage, motion, name, with_speed, limit):
    q_ref, dq_ref = motion
    dq_ref = dq_ref if with_speed else None
    noise = 1e-5 * np.random.default_rng(0).standard_normal(q_ref.shape)
    noise[0] = 0.0
    signals = signals_in_volts(q_ref, dq_ref, noise=noise, limit=np.array([limit]))
    made = run(*carriage, LAWS[name], signals)
    speeds = None if dq_ref is None else dq_ref[:, 0].tolist()
    seen = (made.q + noise)[:, 0].tolist()
    expected = command_of(LAWS[name], RATE, seen, q_ref[:, 0].tolist(), speeds, limit)
    np.testing.assert_allclose(made.command[:, 0], expected, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(made.tau, 35.15 * made.command)
    assert abs(made.command).max() == limit or limit == np.inf


def test_known_inputs_are_added_before_the_limit(carriage, motion):
    q_ref, dq_ref = motion
    inputs = np.where(np.arange(500) // 100 % 2, 5.0, 0.0)[:, None]
    signals = signals_in_volts(q_ref, dq_ref, inputs=inputs, limit=np.array([6.0]))
    law = Cascade([160.18], [243.45], averaged=True)
    made = run(*carriage, law, signals)
    own = command_of(law, RATE, made.q[:, 0], q_ref[:, 0], dq_ref[:, 0])
    np.testing.assert_allclose(
        made.command[:, 0], np.clip(own + inputs[:, 0], -6.0, 6.0), rtol=0, atol=1e-9
    )
    assert (made.command == 6.0).any()


def test_an_integrator_rests_in_the_limit(carriage):
    # a step that the drive cannot follow: an integral that grew meanwhile would overshoot by far
    q_ref = np.full((1500, 1), 0.05)
    q_ref[:10] = 0.0
    still = np.zeros_like(q_ref)
    law = PID([900.0], [40.0], [4000.0])
    made = run(*carriage, law, signals_in_volts(q_ref, still, limit=np.array([2.0])))
    assert abs(made.command).max() == 2.0
    assert made.q.max() < 1.2 * 0.05
    assert abs(made.q[-1, 0] - 0.05) < 1e-3


def test_a_loop_at_rest_starts_without_a_kick(carriage):
    start = np.array([0.3])
    q_ref = np.full((50, 1), 0.3)
    for law in LAWS.values():
        made = run(*carriage, law, signals_of(RATE, q_ref), start=(start, np.zeros(1)))
        # what moves the carriage is the constant torque of its friction law alone
        assert abs(made.command[0, 0]) < 1e-9
        assert abs(made.q - 0.3).max() < 1e-3


def test_the_reference_is_differentiated_as_the_measurement_is():
    # with q = q_ref the law must not act, whatever the filter of its derivative
    q_ref, _ = reversals(300, RATE, [0.1], [4.0])
    for law in (LAWS["PD with filter"], LAWS["PID with filter"], LAWS["PD"]):
        sampled = law.law(RATE, q_ref, None)
        answer = lfilter(sampled.feedback[0], sampled.pole[0], q_ref[:, 0])
        np.testing.assert_allclose(sampled.reference[:, 0], answer, atol=1e-9)


def test_a_pd_law_that_damps_the_speed_is_a_cascade_without_feed_forward():
    q_ref = np.random.default_rng(2).normal(size=(9, 2))
    one = replace(PD([60.0, 25.0], 1.0, speed_feed_forward=0.0), kd=[2.0, 0.8])
    other = Cascade([30.0, 31.25], [2.0, 0.8])
    for ours, theirs in zip(one.law(RATE, q_ref, None)[:2], other.law(RATE, q_ref, None)[:2],
                            strict=True):  # fmt: skip
        np.testing.assert_allclose(ours, theirs)
    reference = other.law(RATE, q_ref, None).reference
    np.testing.assert_allclose(one.law(RATE, q_ref, None).reference, reference)


def test_backward_difference():
    x = np.array([[1.0, 0.0], [2.0, 0.5], [4.0, 0.5]])
    np.testing.assert_array_equal(backward_difference(x, 10.0), [[0, 0], [10, 5], [20, 0]])


@pytest.mark.parametrize("name", LAWS)
def test_the_inverse_undoes_the_feedback(name):
    law = LAWS[name]
    sampled = law.law(RATE, np.zeros((1, 1)), np.zeros((1, 1)))
    numerator, denominator = inverse_controller(law, RATE, 1)
    assert numerator.shape == denominator.shape == (1, TAPS)
    assert denominator[0, 0] == 1.0
    noise = np.random.default_rng(0).standard_normal(400)
    torque = lfilter(sampled.feedback[0], sampled.pole[0], noise)
    np.testing.assert_allclose(lfilter(numerator[0], denominator[0], torque), noise, atol=1e-9)
    assert (abs(np.roots(denominator[0])) < 1.0).all()


class FixedFeedback:
    """A law with any B, for one joint."""

    def __init__(self, feedback):
        self.feedback = np.atleast_2d(np.pad(feedback, (0, TAPS - len(feedback))))

    def law(self, rate, q_ref, dq_ref):
        return PD([1.0], [0.0]).law(rate, q_ref, dq_ref)._replace(feedback=self.feedback)

    def check(self, joints):
        pass


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=TAPS), st.floats(0.1, 100.0))
def test_zeros_outside_the_unit_circle_are_reflected_into_it(rest, first):
    feedback = np.array([first, *[first * r for r in rest[: TAPS - 1]]])
    numerator, denominator = inverse_controller(FixedFeedback(feedback), RATE, 1)
    roots = np.roots(np.trim_zeros(denominator[0], "b"))
    assert (abs(roots) < 1.0).all()
    if (abs(abs(np.roots(np.trim_zeros(feedback, "b"))) - 1.0) < 1e-3).any():
        return  # a zero on the circle is moved, by a millionth
    _, inverse = freqz(numerator[0], denominator[0], 200)
    _, forward = freqz(feedback, 1.0, 200)
    np.testing.assert_allclose(abs(inverse * forward), 1.0, rtol=1e-6)


def test_a_pure_differentiator_keeps_a_stable_inverse():
    numerator, denominator = inverse_controller(PD([0.0], [20.0]), RATE, 1)
    assert 0.9999 < np.roots(denominator[0]).max() < 1.0
    assert np.isfinite(numerator).all()


def test_no_gain_no_inverse():
    with pytest.raises(ExperimentError, match="joint 2 has no gain"):
        inverse_controller(PD([1.0, 0.0], [1.0, 0.0]), RATE, 2)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (PD([1.0], [1.0]), r"kp has shape \(1,\), but the robot has 2 joints"),
        (PD([1.0, -2.0], [1.0, 1.0]), "kp of joint 2 is -2.0"),
        (PD([1.0, 1.0], [np.nan, 1.0]), "kd of joint 1 is nan"),
        (PID([1.0, 1.0], [1.0, 1.0], [np.inf, 0.0]), "ki of joint 1 is inf"),
        (PD([1.0, 1.0], [1.0, 1.0], derivative_time=-1.0), "derivative_time"),
        (PD(1.0, -2.0), "kd of joint 1 is -2.0"),
        (PythonController(print, linear=PD([1.0], [1.0])), "kp has shape"),
    ],
)
def test_gains_of_the_wrong_number_or_sign_are_refused(law, message):
    with pytest.raises(ExperimentError, match=message):
        law.check(2)


def test_a_single_gain_is_that_of_all_joints():
    reference = np.random.default_rng(0).standard_normal((20, 2))
    for one, each in (
        (PID(900.0, 20, 40.0), PID([900.0] * 2, [20.0] * 2, [40.0] * 2)),
        (Cascade(30.0, [8.0, 8.0], 5), Cascade([30.0] * 2, [8.0] * 2, [5.0] * 2)),
    ):
        one.check(2)
        for left, right in zip(
            one.law(RATE, reference, None), each.law(RATE, reference, None), strict=True
        ):
            np.testing.assert_array_equal(left, right)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PD([1.0, 2.0], [1.0]), "kp has 2, kd has 1 gain"),
        (lambda: Cascade([1.0, 1.0], 1.0, [1.0]), "kp has 2, ki has 1 gain"),
        (lambda: PD("big", 1.0), "kp = 'big' is no gain"),
    ],
)
def test_gains_that_do_not_belong_together_are_refused_at_once(make, message):
    with pytest.raises(ExperimentError, match=message):
        make()
