"""Control laws found again from the signals of the controller."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter, lfilter_zi

from pivident.data.recording.public_records import load_emps, load_emps_pulses
from pivident.data.recording.recording import Recording
from pivident.estimation.control_law.identified_law import identify_controller
from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.linear.free_law import identify_free_law
from pivident.loop.simulation.controllers import PID

RATE, LAG = 5000.0, 7.958e-4
KP, KI, KD = 4934.8, 9869.6, 133.76
EMPS_GAIN = 35.15065188248547


def pid_record(noise=0.0, samples=34500, seed=0):
    """A filtered PID on the error of a motion measured with 3600 counts behind a gear of 32."""
    t = np.arange(samples) / RATE
    r = np.sin(2 * np.pi * 0.7 * t) + 0.3 * np.sin(2 * np.pi * 2.1 * t)
    lags = ((0.2, 4e-3), (1.3, 1e-3), (5.0, 2e-3), (30.0, 2e-3))  # slow for ki, fast for kd
    q = r - sum(size * np.sin(2 * np.pi * f * t + f) for f, size in lags)
    step = 2 * np.pi / 3600 / 32
    e = r - np.round(q / step) * step
    derivative = lfilter(
        np.array([1, -1]) * RATE / (LAG * RATE + 1), [1, -LAG / (LAG + 1 / RATE)], e
    )
    u = KP * e + KI * np.cumsum(e) / RATE + KD * derivative
    u += noise * u.std() * np.random.default_rng(seed).normal(size=samples)
    return Recording("pid", ("axis",), (r - e)[:, None], u[:, None], RATE, q_ref=r[:, None])


def test_arx_finds_a_pid_exactly():
    law = identify_free_law(pid_record(), method="arx", orders=(2, 1), integrator=True).law
    wanted = PID(np.array([KP]), np.array([KD]), np.array([KI]), LAG).law(
        RATE, np.zeros((1, 1)), None
    )
    np.testing.assert_allclose(law.numerator, wanted.feedback, rtol=1e-10, atol=1e-6)
    np.testing.assert_allclose(law.denominator[0, :2], wanted.pole[0, :2], rtol=1e-10)
    np.testing.assert_allclose(law.ki, KI, rtol=1e-9)


def test_the_continuous_search_finds_a_law_that_explains_everything():
    """Its parameters are those of the hold-equivalent: the lag is longer by half a period."""
    found = identify_free_law(pid_record(), method="srivc")
    assert found.estimates[0].fit.r2 > 1 - 1e-6
    assert found.estimates[0].denominator[1] == pytest.approx(1121, rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_gains_of_a_pid_with_noise_on_its_output(seed):
    (law,) = identify_controller([pid_record(0.027, seed=seed)]).joints
    assert set(law.terms) == {"kp", "kd", "ki", "speed_reference"}
    assert law.gain("kp") == pytest.approx(KP, rel=1e-3)
    assert law.gain("ki") == pytest.approx(KI, rel=1e-3)
    assert law.gain("kd") == pytest.approx(KD, rel=1e-3)
    assert law.gain("speed_reference") == pytest.approx(law.gain("kd"), rel=1e-4)
    assert law.derivative_time == pytest.approx(LAG, rel=1e-2)
    truth = {"kp": KP, "ki": KI, "kd": KD, "speed_reference": KD}
    error = [law.gain(t) - truth[t] for t in law.terms]
    assert (np.abs(error) < 4 * law.std).all()


def test_without_noise_structure_and_gains_are_exact():
    (law,) = identify_controller([pid_record()]).joints
    assert law.relative_error < 1e-8
    assert law.gain("kp") == pytest.approx(KP, rel=1e-7)
    assert law.gain("ki") == pytest.approx(KI, rel=1e-6)
    assert law.f_tests["ki"] > 1e4


def test_the_law_of_a_simulated_arm_and_its_simulation():
    problem, _ = tx40_scenario("loop", 2)
    found = identify_controller(problem.recordings)
    given = problem.loop.controller
    for j, law in enumerate(found.joints):
        assert set(law.terms) == {"kp", "kd", "speed_reference"}
        assert law.gain("kp") == pytest.approx(given.kp[j], rel=1e-9)
        assert law.gain("kd") == pytest.approx(given.kd[j], rel=1e-9)
        assert law.derivative_time == 0 and not law.averaged
    np.testing.assert_allclose(found.model[3:], found.output[3:], rtol=0, atol=1e-6)
    text = str(found)
    assert "joint_6" in text and "backward difference" in text and "±2σ" in text


def test_saturated_samples_are_left_out():
    whole = pid_record()
    limit = 0.8 * np.abs(whole.tau[500:]).max()
    clipped = dataclasses.replace(whole, tau=np.clip(whole.tau, -limit, limit), saturation="allow")
    (law,) = identify_controller([clipped], limit=limit).joints
    assert law.saturated > 100
    assert law.gain("kp") == pytest.approx(KP, rel=1e-6)


def test_a_reversed_torque_is_refused():
    record = pid_record()
    reversed_torque = dataclasses.replace(record, tau=-record.tau)
    with pytest.raises(IdentificationError, match=r"'axis' has kp = -4.*sign"):
        identify_controller([reversed_torque])


def test_a_position_logged_as_its_reference_is_refused():
    record = pid_record()
    with pytest.raises(IdentificationError, match="no control error"):
        identify_controller([dataclasses.replace(record, q_ref=record.q)])
    with pytest.raises(ExperimentError, match="no reference q_ref"):
        identify_controller([dataclasses.replace(record, q_ref=None)])


def test_orders_beyond_the_simulation_are_refused():
    with pytest.raises(ExperimentError, match="go up to 2"):
        identify_free_law(pid_record(samples=1000), orders=(4, 1))


@pytest.mark.record
def test_the_emps_law_on_both_files(public_data):
    for record in (load_emps(), load_emps_pulses()):
        (law,) = identify_controller([record], EMPS_GAIN, 10.0).joints
        assert law.terms == ("kp", "kd") and law.averaged
        kp, _, kv, _ = law.cascade
        assert kp == pytest.approx(160.18, rel=5e-3)
        assert kv == pytest.approx(243.45, rel=5e-3)
        assert law.rms < 0.01  # V


@pytest.mark.record
def test_the_law_of_one_emps_file_makes_the_voltage_of_the_other(public_data):
    first, second = load_emps(), load_emps_pulses()
    found = identify_controller([first], EMPS_GAIN, 10.0)
    law = found.law.law(second.rate, second.q_ref, second.dq_ref)
    u = law.reference[:, 0] - lfilter(law.feedback[0], law.pole[0], second.q[:, 0])
    pulses = sum(x[:, 0] for x in second.inputs.values())
    error = (second.tau[:, 0] / EMPS_GAIN - pulses - u)[3:]
    assert np.sqrt(np.mean(error**2)) < 0.01


def reference_fed_record(samples=8_000):
    """A PID whose derivative sees the reference's own speed: kp e + kd (dq_ref - D q) + ki ∫e."""
    t = np.arange(samples) / RATE
    rising = np.clip(t / 0.5, 0.0, 1.0) ** 3  # from rest, without an error
    r = 0.4 + rising * (np.sin(2 * np.pi * 0.7 * t) + 0.3 * np.sin(2 * np.pi * 2.1 * t))
    dr = np.diff(r, prepend=r[0]) * RATE
    lags = ((0.2, 4e-3), (1.3, 1e-3), (5.0, 2e-3), (30.0, 2e-3))
    q = r - rising * sum(size * np.sin(2 * np.pi * f * t + f) for f, size in lags)
    law = PID(np.array([KP]), np.array([KD]), np.array([KI]), LAG)
    u = output_of(law.law(RATE, r[:, None], dr[:, None]), q)
    return law, Recording(
        "fed", ("axis",), q[:, None], u[:, None], RATE, q_ref=r[:, None], dq_ref=dr[:, None]
    )


def output_of(law, q):
    """r - B/A q + I of a sampled law whose filters have been at rest at q[0]."""
    pole = law.pole[0]

    def filtered(numerator):
        zi = lfilter_zi(numerator, pole) * q[0]
        return lfilter(numerator, pole, q, zi=zi)[0]

    error = law.integrand_reference[:, 0] - filtered(law.integrand[0])
    summed = np.cumsum(law.integral_gain[0] / RATE * error)
    return law.reference[:, 0] - filtered(law.feedback[0]) + summed


def test_a_law_that_sees_the_reference_needs_its_derivatives():
    """Its derivative acts on the speed of the reference; the error alone does not explain it."""
    law, record = reference_fed_record()
    alone = identify_free_law(record, method="srivc")
    found = identify_free_law(record, method="srivc", reference_inputs=True)
    assert alone.relative_error[0] > 20 * found.relative_error[0]
    assert found.relative_error[0] < 1e-4 and len(found.estimates[0].numerators) == 3
    np.testing.assert_allclose(found.output, record.tau)
    wanted = law.law(RATE, record.q_ref, record.dq_ref)
    made = found.law.law(RATE, record.q_ref, record.dq_ref)
    np.testing.assert_allclose(made.feedback, wanted.feedback, rtol=1e-3)
    np.testing.assert_allclose(made.integral_gain, wanted.integral_gain, rtol=1e-3)
    size = record.tau.std()
    apart = output_of(made, record.q[:, 0]) - record.tau[:, 0]
    assert np.abs(apart[200:]).max() < 1e-2 * size
    with pytest.raises(ExperimentError, match="use srivc with reference_inputs"):
        identify_free_law(record, reference_inputs=True)


def test_a_joint_without_error_is_named():
    record = pid_record(samples=2000)
    still = dataclasses.replace(record, q_ref=record.q.copy())
    with pytest.raises(IdentificationError) as caught:
        identify_free_law(still, method="srivc")
    assert "in the law of joint 'axis'" in caught.value.__notes__
