"""Laws that compensate gravity, found from the record; laws that do not, left as they are."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.control_law.identified_law import identify_controller
from pivident.estimation.control_law.law_gravity import gravity_columns
from pivident.estimation.control_law.unknown_loop import reconstruct_loop
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.judgement.diagnostics.verdict import verdict
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PID
from pivident.loop.simulation.gravity_compensation import GravityCompensated, GravityModel
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

RATE = 1000.0
KP, KD, KI = np.array([6000.0, 2500.0]), np.array([180.0, 60.0]), np.array([2e4, 8e3])
GAIN = np.array([2.0, 4.0])

ROBOT = load_robot("planar_2r")
BASE = base_parameters(ROBOT)
THETA = BASE.values(nominal_values(ROBOT, BASE.standard))
TRUTH = dict(zip([p.name for p in BASE.parameters], THETA, strict=True))


def law_of(kind, scale=0.0, place="measured"):
    """PD or PID, with so many times the robot's gravity, of drives with a gain."""
    law = PID(KP / GAIN, KD / GAIN, KI / GAIN if kind == "pid" else None)
    if scale == 0.0:
        return law
    model = GravityModel.of(ROBOT, BASE.parameters, scale * THETA, GAIN)
    return GravityCompensated(law, **{place: model})


@cache
def record(kind, scale=0.0, place="measured", seed=0, torque=0.05, friction=0.0):
    """A run of the arm with noise of encoders and torque sensors."""
    postures = np.random.default_rng(2).uniform(-1.5, 1.5, (30, 2))
    q_ref, dq_ref, _ = point_to_point(postures, 0.8 * ROBOT.rated_speeds, RATE, 6000)
    rng = np.random.default_rng(seed)
    noise = 2e-6 * rng.standard_normal(q_ref.shape)
    signals = LoopSignals(
        RATE, q_ref, dq_ref, friction * np.tanh(50.0 * dq_ref) / GAIN, noise, GAIN,
        np.full(2, np.inf), np.full(2, 0.5), np.full(2, 50.0),
    )  # fmt: skip
    model = make_model(ROBOT, BASE.parameters, THETA)
    made = simulate(model, law_of(kind, scale, place), signals, ROBOT.joint_names)
    tau = made.tau + torque * rng.standard_normal(q_ref.shape)
    return Recording(
        f"run {seed}", ROBOT.joint_names, made.q + noise, tau, RATE, q_ref=q_ref, dq_ref=dq_ref,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "scale", "place"),
    [("pd", 1.0, "measured"), ("pd", 0.9, "reference"), ("pid", 0.9, "measured")],
)
def test_gains_and_gravity_model_are_found(kind, scale, place):
    inside, errors = 0, []
    for seed in range(3):
        found = identify_controller([record(kind, scale, place, seed)], GAIN, robot=ROBOT)
        for j, law in enumerate(found.joints):
            truth = {"kp": KP[j], "kd": KD[j], "speed_reference": KD[j]}
            truth |= {"ki": KI[j]} if kind == "pid" else {}
            assert set(law.terms) == set(truth)
            assert law.gravity.place == ("gravity" if place == "measured" else "gravity_reference")
            assert [p.name for p in law.gravity.parameters] == ["mx1", "mx2"][j:]
            wanted = [truth[t] / GAIN[j] for t in law.terms]
            wanted += [scale * TRUTH[p.name] for p in law.gravity.parameters]
            got = np.concatenate([law.gains, law.gravity.values])
            std = np.concatenate([law.std, law.gravity.std])
            errors += (np.abs(got / wanted - 1.0)).tolist()
            inside += np.sum(np.abs(got - wanted) < 2.0 * std)
    assert np.median(errors) < 1e-3
    assert inside >= 0.85 * len(errors)


@pytest.mark.parametrize(("kind", "friction"), [("pd", 0.0), ("pid", 0.0), ("pd", 3.0)])
def test_a_law_without_gravity_is_given_none(kind, friction):
    """Not even where the law feeds friction forward, which the identification does not know."""
    for seed in range(3):
        run = record(kind, seed=seed, friction=friction)
        assert all(
            own.gravity is None for own in identify_controller([run], GAIN, robot=ROBOT).joints
        )


def test_without_noise_of_the_torque_the_law_is_exact():
    found = identify_controller([record("pd", 0.9, torque=0.0)], GAIN, robot=ROBOT)
    for j, law in enumerate(found.joints):
        assert law.relative_error < 1e-10
        assert law.gain("kp") * GAIN[j] == pytest.approx(KP[j], rel=1e-8)
        wanted = [0.9 * TRUTH[p.name] for p in law.gravity.parameters]
        np.testing.assert_allclose(law.gravity.values, wanted, rtol=1e-8)
    np.testing.assert_allclose(found.model[3:], found.output[3:], atol=1e-8)


def test_piv_is_as_precise_as_with_the_known_law():
    run = record("pd", 0.9)
    known = identify(Problem(ROBOT, (run,), Loop(law_of("pd", 0.9), GAIN)), "piv")
    recordings, loop = reconstruct_loop(ROBOT, [run], drive_gain=GAIN)
    found = identify(Problem(ROBOT, recordings, loop), "piv")
    # the data may prefer a noise model of the torque residual on a joint: other weights
    assert (np.abs(found.theta - known.theta) < 0.5 * known.std).all()
    np.testing.assert_allclose(found.std, known.std, rtol=0.06)
    assert found.method == "IDIM-PIV (Ĉ)"
    assert any("compensates gravity at the measured position" in w.message for w in found.warnings)
    (told,) = [s for s in verdict(found).statements if "compensates gravity" in s.message]
    assert told.severity == "note"


def test_the_gravity_model_is_told_and_stored():
    found = identify_controller([record("pd", 0.9, "reference")], GAIN, robot=ROBOT)
    text = str(found)
    assert "gravity at" in text and "reference" in text and "mx2" in text and "kg m" in text
    (note,) = found.notes
    assert note.startswith("The control law of shoulder, elbow compensates gravity at the ref")
    shoulder, elbow = Loop(found.law, GAIN, identified=found).law_values()
    assert shoulder["gravity"]["parameters"] == ["mx1", "mx2"]
    assert elbow["gravity"]["at"] == "q_ref" and elbow["gravity"]["units"] == ["kg m"]
    assert elbow["gravity"]["values"] == pytest.approx([0.9 * TRUTH["mx2"]], rel=1e-3)


def test_gravity_needs_a_robot_and_a_joint_that_carries_weight():
    blind = identify_controller([record("pd", 0.9)], GAIN)
    assert all(law.gravity is None for law in blind.joints)
    assert min(law.relative_error for law in blind.joints) > 0.1
    lying = gravity_columns(ROBOT.with_gravity(np.array([0.0, 0.0, -9.81])))
    assert [own.parameters for own in lying] == [(), ()]


def test_gravity_that_the_file_declares_is_that_of_the_description():
    run = record("pd", 1.0)
    declared = Loop(law_of("pd"), GAIN, feed_forward="gravity_measured")
    nominal = law_of("pd", 1.0)
    first, second = (
        identify(Problem(ROBOT, (run,), loop), "piv") for loop in (declared, Loop(nominal, GAIN))
    )
    np.testing.assert_allclose(first.theta, second.theta, rtol=1e-9, atol=1e-12)
    without = identify(Problem(ROBOT, (run,), replace(declared, feed_forward="none")), "piv")
    assert np.abs(without.theta - first.theta).max() > 1e-9
