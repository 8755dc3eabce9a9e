"""Gradients of criteria against complex steps through another inverse dynamic model."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.estimation.solved_equations import EquationNoise
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import read_urdf
from pivident.signals.prefilter import Prefilter
from pivident.studies.excitation.constraints import Constraints
from pivident.studies.excitation.criteria import (
    Criterion,
    Objective,
    condition_number,
    standard_errors,
)
from pivident.studies.excitation.information import Information, assumed_noise
from pivident.studies.excitation.limits import joint_limits
from pivident.studies.excitation.motions import MotionFamily
from pivident.studies.excitation.questions import (
    gain_question,
    load_columns,
    load_question,
    robot_question,
)
from tests.dynamics.newton_euler import torques

STEP = 1e-30
ROBOT = load_robot("planar_2r")
BASE = base_parameters(ROBOT)
VALUES = BASE.values(nominal_values(ROBOT, BASE.standard))
REGRESSOR = Regressor.build(ROBOT, BASE.parameters)
COLOURED = EquationNoise(
    100.0,
    np.zeros(2),
    (
        Prefilter(fir=(1.0, -0.7, 0.2), variance=0.3),
        Prefilter((1.0, 0.4), (1.0, -0.5), (1.0, 0.3), 0.02),
    ),
)
LOAD = np.array([0.01, 0.0, 0.0, 0.02, 0.0, 0.02, 0.1, 0.05, 0.0, 1.5])


def question_of(name):
    if name == "load":
        return load_question(BASE, VALUES, LOAD)
    return gain_question(BASE, VALUES, LOAD) if name == "gains" else robot_question(BASE, VALUES)


def objective(criterion, noise, question, chosen=None):
    family = MotionFamily("splines", 3.0, 9)
    constraints = Constraints.of(family, 12.0, joint_limits(ROBOT), (), None)
    rate = (constraints.functions.shape[1] - 1) / family.duration
    size = question.size
    earlier = 1e-3 * np.eye(size)
    sizes = np.linspace(0.5, 2.0, size)
    return Objective(
        Criterion(criterion, sizes, chosen),
        Information(REGRESSOR, noise, rate, earlier, question),
        constraints,
    )


def complex_matrix(motion):
    """Φ of complex motion, shape (samples, joints, parameters)."""
    q, dq, ddq = motion
    samples, n = q.shape
    phi = np.zeros((samples, n, len(BASE)), complex)
    for k, p in enumerate(BASE.parameters):
        for t in range(samples):
            if p.is_inertial:
                unit = np.zeros((n, len(BASE)))
                unit[:, k] = 1.0
                phi[t, :, k] = torques(ROBOT, BASE.parameters, q[t], dq[t], ddq[t], unit)
        if p.stem == "ia":
            phi[:, p.joint, k] = ddq[:, p.joint]
        elif p.stem == "fv":
            phi[:, p.joint, k] = dq[:, p.joint]
        elif p.stem == "fc":
            gamma = p.friction.encoded()[2][0]
            phi[:, p.joint, k] = 2.0 / np.pi * np.arctan(gamma * dq[:, p.joint])
        elif p.stem == "off":
            phi[:, p.joint, k] = 1.0
    return phi


def complex_information(goal, coefficients):
    """The information of complex coefficients, by the definitions."""
    made = goal.information
    moved = np.einsum("dtk,kj->dtj", goal.constraints.functions[:3], coefficients)
    phi = complex_matrix(moved)
    by_joint = []
    for j in range(ROBOT.size):
        columns = REGRESSOR.columns_of(j)
        operator = made._filtered(j, np.eye(len(phi)), adjoint=False).T
        rows = np.zeros((len(phi), len(BASE)), complex)
        rows[:, columns] = operator @ phi[:, j, columns]
        by_joint.append(rows.T @ rows)
    return made.earlier + made.question.information(by_joint)


def complex_criterion(criterion, information):
    scaled = information * np.outer(criterion.sizes, criterion.sizes)
    covariance = np.linalg.inv(scaled)
    chosen = np.arange(len(scaled)) if criterion.chosen is None else criterion.chosen
    own = covariance[np.ix_(chosen, chosen)]
    if criterion.name == "d":
        return np.log(np.linalg.det(own)) / chosen.size
    if criterion.name == "a":
        return np.log(np.trace(own) / chosen.size)
    return np.log((np.diag(own) ** 8).sum()) / 8


def smooth_motion(goal, seed=5):
    rng = np.random.default_rng(seed)
    return 0.4 * rng.standard_normal((goal.constraints.family.size, ROBOT.size))


@pytest.mark.parametrize("question", ["robot", "load", "gains"])
@pytest.mark.parametrize("criterion", ["d", "a", "worst"])
@pytest.mark.parametrize("noise", ["white", "coloured"])
def test_gradient_against_complex_steps(criterion, noise, question):
    asked = question_of(question)
    chosen = None if question == "robot" else asked.asked
    known = COLOURED if noise == "coloured" else assumed_noise(np.array([0.5, 0.1]), 40.0)
    goal = objective(criterion, known, asked, chosen)
    x = smooth_motion(goal)
    value, gradient = goal.value_and_gradient(x)
    assert value == pytest.approx(complex_criterion(
        goal.criterion, complex_information(goal, x.astype(complex))
    ).real, rel=1e-8)  # fmt: skip
    direction = np.random.default_rng(1).standard_normal(x.shape)  # an error shows in any of them
    moved = x + 1j * STEP * direction
    slope = complex_criterion(goal.criterion, complex_information(goal, moved)).imag / STEP
    assert np.sum(gradient * direction) == pytest.approx(slope, rel=1e-8)


def test_gradient_of_the_condition_number_by_differences():
    goal = objective("cond", assumed_noise(np.ones(2), 12.0), question_of("robot"))
    x = smooth_motion(goal)
    _, gradient = goal.value_and_gradient(x)
    direction = np.random.default_rng(2).standard_normal(x.shape)
    h = 1e-5
    slope = (goal.value(x + h * direction) - goal.value(x - h * direction)) / (2 * h)
    assert np.sum(gradient * direction) == pytest.approx(slope, rel=1e-6)


def test_information_is_that_of_prefiltered_rows_at_the_rate_of_the_record():
    """A periodic motion at the record's own rate, filtered in time by scipy."""
    from scipy.signal import lfilter

    rate, samples = 100.0, 400
    t = np.arange(samples) / rate
    phase = 2 * np.pi * 0.25 * t
    q = np.column_stack([np.sin(phase), 0.6 * np.cos(2 * phase)])
    dq = np.gradient(np.vstack([q, q, q]), 1 / rate, axis=0)[samples : 2 * samples]
    ddq = np.gradient(np.vstack([dq, dq, dq]), 1 / rate, axis=0)[samples : 2 * samples]
    size = len(BASE)
    made = Information(
        REGRESSOR, COLOURED, rate, np.zeros((size, size)), robot_question(BASE, VALUES)
    )
    expected = np.zeros((size, size))
    phi = REGRESSOR.matrix(q, dq, ddq)
    for j, f in enumerate(COLOURED.filters):
        again = np.vstack([phi[:, j]] * 3)  # the filter forgets its start
        filtered = lfilter(np.convolve(f.fir, f.numerator), f.denominator, again, axis=0)
        rows = filtered[2 * samples :] / np.sqrt(f.variance)
        expected += rows.T @ rows
    np.testing.assert_allclose(made.of((q, dq, ddq)), expected, rtol=1e-9, atol=1e-9)


def test_a_sample_counts_for_the_rows_that_the_record_will_have():
    noise = assumed_noise(np.array([0.5, 0.1]), 40.0)
    family = MotionFamily("fourier", 6.0, 9)
    x = 0.3 * np.random.default_rng(0).standard_normal((9, 2))
    found = []
    for rate in (100.0, 400.0):
        t = np.arange(int(6.0 * rate)) / rate
        motion = family.functions(t)[:3] @ x
        made = Information(
            REGRESSOR, noise, rate, np.zeros((len(BASE),) * 2), robot_question(BASE, VALUES)
        )
        found.append(standard_errors(made.of(tuple(motion))))
    np.testing.assert_allclose(found[0], found[1], rtol=5e-3)


def test_samples_at_standstill_do_not_count_where_the_estimator_leaves_them_out():
    still = EquationNoise(40.0, np.array([0.0, 0.2]), (Prefilter(), Prefilter()))
    made = Information(
        REGRESSOR, still, 40.0, np.zeros((len(BASE),) * 2), robot_question(BASE, VALUES)
    )
    dq = np.array([[0.1, 0.1, 0.5], [0.1, 0.3, 0.1]])
    np.testing.assert_array_equal(made.used(dq), [[1, 1, 1], [0, 1, 0]])


def test_standard_errors_are_infinite_only_where_nothing_is_known():
    matrix = np.diag([4.0, 0.0, 1.0])
    matrix[0, 2] = matrix[2, 0] = 1.0
    found = standard_errors(matrix)
    assert np.isinf(found[1])
    np.testing.assert_allclose(found[[0, 2]], np.sqrt(np.diag(np.linalg.inv([[4, 1], [1, 1]]))))
    twin = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert np.isinf(standard_errors(twin)).all()
    assert condition_number(twin) == np.inf


def test_condition_number_is_numpys():
    matrix = np.random.default_rng(4).standard_normal((50, 6))
    assert condition_number(matrix.T @ matrix) == pytest.approx(np.linalg.cond(matrix), rel=1e-9)


def test_a_load_is_known_half_as_well_as_the_arm_would_be():
    """With the arm free in both runs, cov(load) = 2 (KᵀAK)⁻¹ by a closed form."""
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    regressor = Regressor.build(robot, base.parameters)
    values = base.values(nominal_values(robot, base.standard))
    load = np.array([0.02, 0, 0, 0.02, 0, 0.01, 0.02, 0.02, 0.2, 2.0])
    question = load_question(base, values, load)
    rng = np.random.default_rng(0)
    motion = tuple(rng.uniform(-2, 2, (3, 200, 6)))
    noise = assumed_noise(np.ones(6), 40.0)
    size = question.size
    made = Information(regressor, noise, 40.0, np.zeros((size, size)), question)
    found = standard_errors(made.of(motion))[-10:]
    phi = regressor.matrix(*motion).reshape(-1, len(base))
    k = load_columns(base)
    expected = np.sqrt(np.diag(2.0 * np.linalg.inv(k.T @ phi.T @ phi @ k)))
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_load_columns_are_those_of_a_heavier_last_link():
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    body = np.array([0.02, 0.001, 0.002, 0.02, 0.003, 0.01, 0.02, 0.02, 0.2, 2.0])
    last = robot.links[-1]
    heavier = replace(robot, links=(*robot.links[:-1], replace(last, inertia=last.inertia + body)))
    before, after = (base.values(nominal_values(r, base.standard)) for r in (robot, heavier))
    np.testing.assert_allclose(load_columns(base) @ body, after - before, atol=1e-12)


def test_parameters_of_a_load_regroup_with_each_other(tmp_path):
    """A slide at 45° to the axis of rotation: three of the moments of inertia act as one sum."""
    links = "".join(
        f'<link name="l{k}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
        'ixz="0" iyz="0"/></inertial></link>'
        for k in range(3)
    )
    joints = "".join(
        f'<joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="9" velocity="2"/></joint>'
        for k, (kind, axis) in enumerate((("revolute", "0 0 1"), ("prismatic", "1 0 1")))
    )
    file = tmp_path / "slide.urdf"
    file.write_text(f'<robot name="slide">{links}{joints}</robot>')
    base = base_parameters(read_urdf(file))
    load = np.array([2.0, 0, 0, 3.0, 0, 5.0, 0.1, 0.2, 0.3, 1.5])
    question = load_question(base, np.ones(len(base)), load)
    names, values = question.names[len(base) :], question.values[len(base) :]
    assert "load xxr" in names and "load zz" not in names
    about_the_axis = 0.5 * (2.0 + 5.0)  # n = (∓1, 0, 1)/√2 in the frame of the slide
    assert 0.5 * values[names.index("load xxr")] == pytest.approx(about_the_axis)
    added = question.runs[1][0][:, len(base) :] @ values
    np.testing.assert_allclose(added, load_columns(base) @ load, atol=1e-12)
    assert any("xxr = xx" in note for note in question.notes)
