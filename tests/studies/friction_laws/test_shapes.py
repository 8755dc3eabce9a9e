"""Constants of shape: search, intervals, and what cannot be told. Long: friction_law_recovery."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identify import build_regression, identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.methods import METHODS
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.robot.friction import FrictionLaw, coulomb, offset, stribeck, viscous
from pivident.studies.friction_laws.filtered_rows import LastPass, ShapedRows
from pivident.studies.friction_laws.shape_constants import shape_constants
from pivident.studies.friction_laws.shapes import identify_shapes
from tests.studies.friction_laws.friction_axis import GAMMA, Axis, Noise, Truth
from tests.studies.friction_laws.friction_cases import CASES

LS = LeastSquares(signals=RandomWalk())
NOISE = Noise(encoder=2e-7, torque=0.3)
STRIBECK = CASES["Stribeck"]


@pytest.fixture(scope="module")
def problem():
    return Axis(STRIBECK.truth, noise=NOISE).problem(STRIBECK.law, seed=0)


@pytest.fixture(scope="module")
def found(problem):
    return identify_shapes(problem, LS)


def test_equals_a_general_nonlinear_least_squares_solver(problem, found):
    """Oracle: scipy's Levenberg–Marquardt on all unknowns at once, same rows."""
    from scipy.optimize import least_squares

    shaped = FrictionLaw((viscous(), coulomb(gamma=GAMMA), offset()))
    plain = replace(problem, robot=problem.robot.with_friction(shaped))
    phi, tau = build_regression(plain, RandomWalk())
    names = list(plain.names)
    dq = phi[:, 0, names.index("fv1")]
    sign = phi[:, 0, names.index("fc1")]

    def residual(x):
        column = sign * np.exp(-((dq / np.exp(x[-1])) ** 2))
        return tau[:, 0] - phi[:, 0] @ x[:-2] - x[-2] * column

    oracle = least_squares(residual, [2.0, 2.0, 4.0, 0.0, 1.0, np.log(0.2)], xtol=1e-14)
    assert found.shape("stribeck_speed").value == pytest.approx(np.exp(oracle.x[-1]), rel=1e-3)
    assert found.identification.value("fs1") == pytest.approx(oracle.x[-2], rel=1e-3)
    # white residuals: the formula is the solver's own covariance
    gram = np.linalg.inv(oracle.jac.T @ oracle.jac) * 2.0 * oracle.cost / len(tau)
    speed = np.sqrt(found.formula_covariance[-1, -1]) / found.shape("stribeck_speed").value
    assert speed == pytest.approx(np.sqrt(gram[-1, -1]), rel=0.02)


def test_derivative_columns_are_those_of_the_torque(problem):
    base = identify(problem, LS)
    last = LastPass.of(problem, LS, base)
    motions = [r.kinematics for r in last.equations.records]
    constants = shape_constants(problem.robot, 0, ["stribeck_speed"], motions)
    rows = ShapedRows(last, problem.robot, constants)
    u, h = np.array([np.log(0.3)]), 1e-3
    torque = [(base.theta[rows.columns[-1]] * rows._changed(u + d)[0][0])[0] for d in (h, -h)]
    derivative = (torque[0] - torque[1]) / (2.0 * h)
    assert rows._moving(u, base.theta)[0][0][1] == pytest.approx(derivative, rel=1e-9)
    sums = rows.sums(u, base.theta)
    moving = rows._moving(u, base.theta)[0][0]
    whole = np.vstack([rows.records[0].phi, moving])
    assert np.allclose(sums.ff, whole @ whole.T, rtol=1e-12)
    assert sums.columns.tolist()[-1] == base.theta.size


def test_truth_lies_within_the_intervals(found):
    speed = found.shape("stribeck_speed")
    assert found.converged and speed.identifiable
    assert speed.low < 0.1 < speed.high
    assert speed.high / speed.low < 1.1
    estimate = found.identification
    errors = {n: (estimate.value(n) - v) for n, v in STRIBECK.parameters.items()}
    std = dict(zip([n.removesuffix("r") for n in estimate.names], estimate.std, strict=True))
    assert all(abs(errors[n]) < 3.5 * std[n] for n in errors)
    assert "stribeck_speed[axis]" in str(found)


def test_intervals_of_levels_know_that_the_speed_is_an_estimate(problem, found):
    """Given its Stribeck speed the level seems better known than it is."""
    given = identify(found.problem, LS)
    k = given.names.index("fs1")
    assert found.identification.robust_std[k] > 1.2 * given.robust_std[k]


@pytest.mark.parametrize("name", ["ripple", "counterbalance", "Dahl", "LuGre", "power"])
def test_recovers_other_laws(name):
    case = CASES[name]
    problem = Axis(case.truth, noise=NOISE).problem(case.law, seed=1)
    shaped = identify_shapes(problem, LS, {"axis": list(case.shapes)}, profiles=False)
    for own in shaped.shapes:
        c, true = own.constant, case.shapes[own.constant.name]
        error = c.coordinate(c.value) - c.coordinate(true)
        assert abs(error) < 3.5 * own.std / c.slope(c.value), own.label


def test_moment_equations_with_simulated_instruments():
    """Prefiltered IV: noisier encoder, where least squares is biased."""
    noisy = Axis(STRIBECK.truth, noise=Noise(encoder=2e-6, torque=0.1))
    problem = noisy.problem(STRIBECK.law, seed=0)
    least_squares = identify_shapes(problem, LS, profiles=False)
    piv = identify_shapes(problem, METHODS["piv"], profiles=False)
    assert piv.converged
    bias = abs(least_squares.identification.value("fs1") - 2.0)
    assert bias > 0.1 > 2.0 * abs(piv.identification.value("fs1") - 2.0)
    assert piv.shape("stribeck_speed").value == pytest.approx(0.1, rel=0.02)


def test_decimated_rows_agree_with_the_full_rate(problem, found):
    decimated = identify_shapes(problem, METHODS["ls"])
    speed = decimated.shape("stribeck_speed")
    assert speed.low < 0.1 < speed.high
    assert speed.std > found.shape("stribeck_speed").std


def test_says_what_the_record_does_not_bound():
    """Without Stribeck friction its speed means nothing (Davies 1977)."""
    truth = CASES["Coulomb"].truth
    problem = Axis(truth, noise=NOISE).problem(STRIBECK.law, seed=3)
    shaped = identify_shapes(problem, LS)
    speed = shaped.shape("stribeck_speed")
    assert not speed.identifiable
    assert "not identifiable" in speed.note and speed.note in shaped.notes
    assert speed.low == speed.constant.low or speed.high == speed.constant.high


def test_slope_of_the_smoothed_sign_can_be_sought():
    law = FrictionLaw((viscous(), coulomb(gamma=10.0), offset()))
    fine = Noise(encoder=1e-9, torque=0.3)  # a smoothed reversal looks less steep
    problem = Axis(CASES["Coulomb"].truth, noise=fine).problem(law, seed=0)
    gamma = identify_shapes(problem, LS, ["gamma"]).shape("gamma")
    assert gamma.low < 50.0 < gamma.high
    assert gamma.constant.unit == "s/rad"


def test_errors_name_the_joint_and_the_next_step(problem):
    with pytest.raises(ExperimentError, match=r"stribeck_sped.*did you mean|stribeck_speed"):
        identify_shapes(problem, LS, {"axis": ["stribeck_sped"]})
    with pytest.raises(ExperimentError, match="no joint's friction"):
        identify_shapes(problem, LS, ["slip_distance1"])
    with pytest.raises(IdentificationError, match="DIDIM"):
        identify_shapes(problem, "didim")
    plain = FrictionLaw((viscous(), coulomb()))
    with pytest.raises(ExperimentError, match="no friction law has a free shape constant"):
        identify_shapes(replace(problem, robot=problem.robot.with_friction(plain)), LS)
    without = replace(problem, parameters=("zz1", "fv1", "fc1"))
    with pytest.raises(ExperimentError, match="not among the parameters"):
        identify_shapes(without, LS)


def test_axis_simulation_is_in_equilibrium():
    """The oracle itself: held torque and motion agree with the law, friction taken by hand."""
    axis = Axis(Truth(fcp=4, fcn=4, fs=2), noise=Noise(0.0, 0.0))
    r = axis.recording(0)
    h = 1.0 / r.rate
    dq = np.gradient(r.q[:, 0], h)
    ddq = (r.q[2:, 0] - 2 * r.q[1:-1, 0] + r.q[:-2, 0]) / h**2
    v = dq[1:-1]
    friction = 2.5 * v + 0.3 + 2 / np.pi * np.arctan(50 * v) * (4 + 2 * np.exp(-((v / 0.1) ** 2)))
    tau = 0.5 * (r.tau[1:-1, 0] + r.tau[:-2, 0])
    smooth = np.abs(v) > 0.05
    error = (2.0 * ddq + friction - tau)[smooth]
    assert np.sqrt(np.mean(error**2)) < 2e-3 * np.sqrt(np.mean(tau**2))
    assert np.allclose(stribeck(0.1).shape("stribeck_exponent").value, 2.0)
