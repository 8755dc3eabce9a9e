"""Torques of sensors behind the gears: the model without motors, against Pinocchio and truth."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.grouping.closed_form import closed_form_base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.errors import ExperimentError
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.validation.divergence_cause import missing_inertia
from pivident.robot.friction import FrictionLaw, offset, viscous
from pivident.robot.gallery import load_robot
from pivident.robot.robot_values import robot_of_values, robot_values
from pivident.robot.urdf import parse_urdf
from pivident.studies.friction.bearing_friction import bearing_friction
from tests.seven_axis_arm import COULOMB, RATE, VISCOUS, seven_axis_log

pytest.importorskip("mujoco")

made = cache(seven_axis_log)


def recording(log, tau=None, side="link") -> Recording:
    """The sensors sample the torque at the instants of the encoders."""
    robot = parse_urdf(log.urdf)
    tau = log.tau_link if tau is None else tau
    return Recording(
        "run", robot.joint_names, log.q, tau, RATE, torque_timing="sampled", torque_side=side
    )


def test_a_sensor_samples_what_a_motor_holds():
    """Unless it is said; in a thinned log half a sample more would be a friction of its own."""
    log = made(3)
    names = parse_urdf(log.urdf).joint_names
    motor, sensor = (
        Recording.from_arrays(log.q, log.tau_link, RATE, joint_names=names, torque_side=side)
        for side in ("motor", "link")
    )
    assert (motor.torque_timing, sensor.torque_timing) == ("held", "sampled")
    assert replace(sensor, torque_timing="averaged").torque_timing == "averaged"
    robot = parse_urdf(log.urdf).with_link_torques(FrictionLaw((viscous(), offset())))
    thin = Recording("run", names, log.q[::20], log.tau_link[::20], RATE / 20, torque_side="link")
    held = replace(thin, torque_timing="held")
    found, wrong = (identify(Problem(robot, (log,)), PrefilteredIV()) for log in (thin, held))
    friction = [name.startswith("fv") for name in found.names]  # these bearings have none
    assert np.abs(found.theta / found.std)[friction].max() < 3.0
    assert (wrong.theta / wrong.std)[friction].max() > 4.0


def problem(log, tau=None, side="link", **options) -> Problem:
    return Problem(parse_urdf(log.urdf), (recording(log, tau, side),), **options)


def test_rotors_and_drives_leave_the_model():
    arm = load_robot("staubli_tx40")
    bare = arm.with_link_torques()
    base = base_parameters(bare)
    stems = {p.stem for p in base.standard}
    assert stems.isdisjoint({"ia", "iam", "fvm", "fcm"}) and {"zz", "fv", "fc", "off"} <= stems
    assert not any("ia" in text for text in base.expressions)
    assert not bare.rotor_inertia.any() and not bare.couplings and not bare.friction_nominal
    assert bare.with_link_torques(FrictionLaw((viscous(),))) is bare
    other = arm.with_link_torques(FrictionLaw((offset(),)))
    assert {str(joint.friction) for joint in other.joints} == {"off"}
    assert robot_of_values(robot_values(bare)).torque_side == "link"


def test_the_rules_of_grouping_agree_with_the_observation_matrix():
    for name in ("staubli_tx40", "planar_2r", "emps"):
        robot = load_robot(name).with_link_torques()
        numeric, closed = base_parameters(robot), closed_form_base_parameters(robot, "names")
        assert closed.numeric().names == numeric.names
        assert np.allclose(closed.numeric().regrouping, numeric.regrouping, atol=1e-9)


def test_the_links_are_found_as_they_are():
    """Estimates against the bodies, torques of other motions against Pinocchio."""
    import pinocchio

    log = made(0)
    given = problem(log)
    assert given.robot.torque_side == "link" and not any("ia" in n for n in given.names)
    result = identify(given, LeastSquares(signals=Bandpass(cutoff=60.0)))
    truth = given.base.values(nominal_values(given.robot, given.base.standard))
    links = [k for k, p in enumerate(result.parameters) if p.is_inertial]
    off = np.abs(result.theta - truth)[links] / np.hypot(result.robust_std, 2e-4)[links]
    assert np.median(off) < 1.5 and off.max() < 6.0

    model = pinocchio.buildModelFromXML(log.urdf)
    q, dq, ddq = np.random.default_rng(5).uniform(-1.0, 1.0, (3, 200, 7))
    data = model.createData()
    exact = np.array([pinocchio.rnea(model, data, *x) for x in zip(q, dq, ddq, strict=True)])
    rubbing = [k for k, p in enumerate(result.parameters) if p.friction is not None]
    without = result.theta.copy()
    without[rubbing] = 0.0
    made_of = replace(result, judged=None, theta=without).predict(q, dq, ddq)
    error = np.sqrt(np.mean((made_of - exact) ** 2, axis=0)) / np.std(exact, axis=0)
    assert (error < 0.02).all()


def test_rotors_would_be_estimated_as_zero_and_widen_the_intervals():
    log = made(0)
    motors = identify(problem(log, side="motor"), "ls")
    links = identify(problem(log), "ls")
    rotors = [n for n in motors.names if n.startswith("ia")]
    assert rotors and not [n for n in links.names if n.startswith("ia")]
    assert links.relative_error == pytest.approx(motors.relative_error, rel=0.02)
    common = [p.name for p in links.parameters if p.stem == "zz"]
    narrower = [
        links.method_std[[p.name for p in links.parameters].index(n)]
        < motors.method_std[[p.name for p in motors.parameters].index(n)] * 1.0001
        for n in common
    ]
    assert all(narrower)


def test_friction_of_bearings_stays_where_it_is():
    log = made(1)
    _, dq, _ = log.motion
    here = np.array([0, 1, 0, 0, 1, 0, 0])
    rubbing = here * 0.15 * (COULOMB * np.tanh(dq / 1e-3) + VISCOUS * dq)
    found = bearing_friction(problem(log, log.tau_link + rubbing))
    laws = [{t.stem for t in joint.friction.terms} for joint in found.robot.joints]
    assert laws == [{"fv", "fc", "off"} if own else {"off"} for own in here]
    result = identify(found, "ls")
    for j in np.flatnonzero(here):
        assert result.value(f"fc{j + 1}") == pytest.approx(0.15 * COULOMB[j], rel=0.05)
        assert result.value(f"fv{j + 1}") == pytest.approx(0.15 * VISCOUS[j], rel=0.15)
    (finding,) = found.findings
    assert "joint_2: fv2" in finding.message and "Of joint_1, joint_3" in finding.message
    p_values = np.array([finding.evidence[f"joint_{j + 1}"].value for j in range(7)])
    assert ((p_values < 0.01) == here.astype(bool)).all()


def test_friction_that_is_zero_rarely_stays():
    """Level 1 %: of 42 joints without friction at most three keep some (p = 0.001 of more)."""
    kept = 0
    for seed in range(6):
        log = made(seed, seconds=10.0)
        found = bearing_friction(problem(log))
        kept += sum("fc" in {t.stem for t in j.friction.terms} for j in found.robot.joints)
    assert kept <= 3


def test_laws_of_ones_own_are_not_tested():
    given = problem(made(1))
    assert bearing_friction(replace(given, parameters=("zz1", "fv1", "fc1"))).findings == ()
    motors = problem(made(1), side="motor")
    assert bearing_friction(motors) is motors


def test_results_say_what_the_torques_are(tmp_path):
    log = made(1)
    result = identify(bearing_friction(problem(log)), "ls")
    result.save(tmp_path)
    loaded = load_identification(tmp_path)
    assert loaded.robot.torque_side == "link"
    for own in (result, loaded):
        kinds = [w.kind for w in own.warnings if w.topic == "torque side"]
        assert kinds == ["link", "bearings"]
        assert "Note: The torques are those of sensors behind the gears" in own.summary()
    stated = [s for s in verdict(result).statements if s.topic == "torque side"]
    assert len(stated) == 2 and all(s.severity == "note" for s in stated)
    assert "sensors behind the gears" in " ".join(recording(log).account)


def test_missing_rotors_are_not_missed():
    assert missing_inertia(problem(made(1))) == []
    assert "rotor inertia" in missing_inertia_of_motors()


def missing_inertia_of_motors() -> str:
    from pivident.loop.simulation.control_loop import Loop
    from pivident.loop.simulation.controllers import PD

    loop = Loop(PD(np.full(7, 100.0), np.full(7, 10.0)))
    return " ".join(missing_inertia(problem(made(1), side="motor", loop=loop)))


def test_both_kinds_of_torque_do_not_mix():
    log = made(1)
    robot = parse_urdf(log.urdf)
    runs = (recording(log), replace(recording(log), name="other", torque_side="motor"))
    with pytest.raises(ExperimentError, match="'other' has torques of the motors, but other"):
        Problem(robot, runs)
    with pytest.raises(ExperimentError, match="torques of the motors, but 'seven_axis_arm' is"):
        Problem(robot.with_link_torques(), runs[1:])
