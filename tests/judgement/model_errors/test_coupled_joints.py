"""Loops that a description leaves out are named by the joints that they tie."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.forced_trees.misfit import misfit
from benchmarks.forced_trees.models import FORCED

import pivident as pv
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.model_errors.cause import Reach
from pivident.judgement.model_errors.coupling_errors import (
    COUPLED,
    DIFFERENCE,
    END,
    FIRST,
    SECOND,
    SUM,
    coupling_causes,
)
from pivident.judgement.model_errors.named_causes import named_causes
from pivident.loop import virtual_pd
from pivident.robot.gallery import load_robot

REACH = Reach(np.array([-1.0, 0.1]), np.array([0.6, 0.5]), *np.ones((3, 2)))

PHASES = [(m, n, phase) for m, n in (DIFFERENCE, SUM) for phase in (0.0, np.pi / 2)]
OWN_PHASES = [(m, n, phase) for m, n in (FIRST, SECOND) for phase in (0.0, np.pi / 2)]


def forced(mechanism: str, name: str):
    return next(f for f in FORCED if (f.mechanism, f.name) == (mechanism, name))


def sliding_second():
    """Two joints, the second slides."""
    robot = load_robot("planar_2r")
    return replace(robot, joints=(robot.joints[0], replace(robot.joints[1], kind="prismatic")))


def path(t, order):
    """Positions of two joints and their derivatives in closed form, shape (2, samples)."""
    rates, middle, size = np.array([[2.0], [3.1]]), [[-0.2], [0.3]], np.array([[0.8], [0.2]])
    turn = rates * t + 0.5 * np.pi * order + [[0.3], [1.0]]
    return size * rates**order * np.sin(turn) + (np.array(middle) if order == 0 else 0.0)


def lagrange(energy, t, h=1e-4):
    """τ = d/dt ∂L/∂dq - ∂L/∂q of L(q, dq) by differences along the path, shape (2, samples)."""

    def slope(t, which):
        found = []
        for j in range(2):
            ends = []
            for sign in (1.0, -1.0):
                state = [path(t, 0), path(t, 1)]
                state[which][j] += sign * h
                ends.append(energy(*state))
            found.append((ends[0] - ends[1]) / (2.0 * h))
        return np.array(found)

    return (slope(t + h, 1) - slope(t - h, 1)) / (2.0 * h) - slope(t, 0)


def test_torques_of_a_pair_are_those_of_lagranges_equations():
    pair, *_ = coupling_causes(sliding_second(), REACH)
    t = np.linspace(0.0, 4.0, 41)
    found = pair.columns(SimpleNamespace(q=path(t, 0), dq=path(t, 1), ddq=path(t, 2)))

    def phase(q, m, n, at):
        return np.cos(m * q[0] + n * END / 0.2 * (q[1] - 0.3) - at)

    energies = [lambda q, dq: dq[0] * dq[1]]
    energies += [lambda q, dq, p=p: phase(q, *p) * dq[0] * dq[1] for p in PHASES]
    energies += [lambda q, dq, p=p: -phase(q, *p) for p in PHASES + OWN_PHASES]
    expected = np.array([lagrange(energy, t) for energy in energies])
    assert found.shape == expected.shape == (pair.count, 2, t.size)
    np.testing.assert_allclose(found, expected, atol=2e-6 * np.abs(expected).max())


def test_torques_of_three_are_those_of_lagranges_equations():
    robot = forced("delta", "three arms").robot
    causes = list(coupling_causes(robot, Reach(-np.ones(3), *np.ones((4, 3)))))
    (three,) = (c for c in causes if c.subject.count(",") == 2)
    assert sum("inertia" in c.what for c in causes) == 4
    q, ddq = np.random.default_rng(1).normal(size=(2, 3, 4))
    columns = three.columns(SimpleNamespace(q=q, ddq=ddq))
    for signal, first in ((ddq, 0), (q, 1)):
        for k, (i, j) in enumerate([(0, 1), (0, 2), (1, 2)]):
            expected = np.zeros((3, 4))
            expected[i], expected[j] = signal[j], signal[i]
            np.testing.assert_array_equal(columns[2 * k + first], expected)


def test_of_a_serial_arm_only_pairs_are_tried():
    robot = load_robot("staubli_tx40")
    reach = Reach(-np.ones(6), *np.ones((4, 6)))
    causes = list(coupling_causes(robot, reach))
    assert len(causes) == 15 + 30 + 30
    assert {c.subject.count(",") for c in causes} == {1}


def test_friction_of_a_motor_takes_the_power_of_the_speed_it_turns_with():
    """Σ τ dq = f(v) v with v = dq_i ± dq_k; behind the gears there are no motors."""
    robot = load_robot("planar_2r")
    q, dq = np.random.default_rng(1).normal(size=(2, 2, 6))
    motion = SimpleNamespace(q=q, dq=dq)
    causes = {c.what: c for c in coupling_causes(robot, REACH)}
    slope = min(joint.default_gamma for joint in robot.joints)
    for word, speed in (("sum", dq[0] + dq[1]), ("difference", dq[1] - dq[0])):
        columns = causes[f"friction of a motor that turns with the {word} of both"].columns(motion)
        dry = 2.0 / np.pi * np.arctan(slope * speed)
        expected = [speed**2, dry * speed]
        np.testing.assert_allclose(np.sum(columns * dq, axis=1), expected, atol=1e-12)
    link = coupling_causes(robot.with_link_torques(), REACH)
    assert not any("motor" in c.what for c in link)


def test_torques_that_were_not_converted_are_named_with_their_part():
    """The elbow's motor sits on the base: its torque is missing from the shoulder's."""
    robot = load_robot("planar_2r")
    loop = pv.Loop(virtual_pd(robot, np.zeros(2)))
    made = pv.simulate(robot, loop, duration=8.0, rate=500, encoder=1e-6, torque=0.02, seed=4)
    tau = made.recording.tau.copy()
    tau[:, 0] -= tau[:, 1]
    record = pv.Recording.from_arrays(made.recording.q, tau, 500.0, joint_names=robot.joint_names)
    problem = pv.Problem(robot, (record,))
    found = named_causes(problem, pv.identify(problem, "ls"))
    (part,) = found.named
    assert (part.cause.kind, part.cause.unit) == (COUPLED, "%")
    assert part.cause.what == "a part of the torque of elbow in that of shoulder"
    size, std = part.size
    assert abs(size + 100.0) < 4.0 * std and std < 1.0
    statements = verdict(diagnose(problem, {"ls": pv.identify(problem, "ls")}, folds=0)).statements
    (finding,) = (s for s in statements if s.kind == COUPLED)
    assert f"in that of shoulder: {part.size_text})" in finding.message
    assert "whether torques were converted" in finding.next_step


@pytest.mark.parametrize("one", FORCED, ids=lambda f: f"{f.mechanism}-{f.name}")
def test_what_a_description_without_loops_cannot_make(one):
    """A palletizer with absolute angles and a level wrist is a tree but for its thin rods."""
    left = misfit(load_robot(one.mechanism), one).max()
    assert left < 0.003 if one.exact else left > 0.008


@pytest.fixture(scope="module")
def five_bar():
    """A record by MuJoCo, its loop."""
    pytest.importorskip("mujoco")
    from benchmarks.closed_mechanisms import ENCODER, RATE, gains_of, reference
    from benchmarks.mujoco_mechanism import mujoco_record

    robot = load_robot("five_bar")
    q_ref = reference(robot, 6.0)
    gains = gains_of(robot, q_ref[0])
    made = mujoco_record(robot, q_ref, RATE, gains, np.full(2, ENCODER), 1)
    tau = made.tau + 0.1 * np.random.default_rng(2).normal(size=made.tau.shape)
    record = pv.Recording("five-bar", robot.joint_names, made.q, tau, RATE, q_ref=q_ref)
    return record, pv.Loop(pv.PD(kp=gains[0], kd=gains[1]))


def test_the_mechanism_itself_has_no_coupled_joints(five_bar):
    problem = pv.Problem(load_robot("five_bar"), *five_bar)
    found = named_causes(problem, pv.identify(problem, "piv"))
    assert [one for one in found.named if one.cause.kind == COUPLED] == []


@pytest.mark.parametrize("method", ["ls", "iv", "piv"])
@pytest.mark.parametrize("name", ["two arms", "serial arm", "absolute angle"])
def test_a_loop_that_is_not_described_is_a_reservation(five_bar, name, method):
    problem = pv.Problem(forced("five_bar", name).robot, *five_bar)
    result = pv.identify(problem, method)
    diagnostics = diagnose(problem, {method: result}, folds=0)
    said = verdict(diagnostics)
    (finding,) = (s for s in said.statements if s.kind == COUPLED)
    assert said.severity in ("warning", "error") and finding.severity == "warning"
    assert "left, right" in finding.message
    assert finding.evidence["torque"].value > 1.0 and finding.evidence["explained"].value > 50.0
    if problem.robot.constraints is None:
        assert "[[loops]]" in finding.next_step
    else:
        assert finding.next_step.startswith("Check the loops and gears")
    assert np.array_equal(diagnostics.identifications[method].covariance, result.covariance)


def test_three_arms_of_a_delta_are_named_together():
    robot = load_robot("delta")
    loop = pv.Loop(virtual_pd(robot, np.radians([-25.0, -25.0, -25.0])))
    t = np.arange(0.0, 6.0, 0.002)[:, None]
    waves = np.sin([7.1, 8.3, 9.7] * t) + 0.7 * np.sin([13.1, 11.9, 15.3] * t + [0.0, 1.0, 2.0])
    q_ref = np.radians(-25.0) + 0.25 * np.clip(t, 0.0, 1.0) ** 2 * waves
    made = pv.simulate(robot, loop, q_ref, rate=500, encoder=2e-5, torque=0.02, seed=1)
    wrong = forced("delta", "three arms").robot
    record = made.recording
    given = pv.Recording.from_arrays(
        record.q, record.tau, 500.0, joint_names=wrong.joint_names, q_ref=record.q_ref
    )
    problem = pv.Problem(wrong, (given,), loop)
    first, *_ = named_causes(problem, pv.identify(problem, "piv")).named
    assert first.cause.kind == COUPLED
    assert first.cause.subject == "motor_1, motor_2, motor_3"
    assert first.torques.max() > 0.02
    right = pv.Problem(robot, (record,), loop)
    named = named_causes(right, pv.identify(right, "piv")).named
    assert COUPLED not in [one.cause.kind for one in named]
