"""Known, bounded, expected and tied parameters: against statsmodels, linearmodels and quadprog."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.coverage_of_parameters import runs_of
from scipy.optimize import LinearConstraint, lsq_linear, minimize

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.equation_record import accumulate
from pivident.estimation.identify import identify
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.known_parameters import Equality, Prior
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.normal_equations import solve
from pivident.estimation.prefiltered_iv import PIV
from pivident.estimation.problem import Problem
from pivident.estimation.restrictions import Restrictions
from pivident.estimation.signal_recipes import RandomWalk
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.errors import ExperimentError
from pivident.judgement.validation.essential_parameters import essential_parameters
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.loop.simulation.control_loop import Loop
from tests.planar_arm import LAW, nominal_parameters, planar_motion, planar_record

RATE = 500.0
FULL = LeastSquares(signals=RandomWalk())
IV = InstrumentalVariables(signals=RandomWalk())


@pytest.fixture(scope="module")
def problem():
    rng = np.random.default_rng(3)
    base, theta = nominal_parameters()
    q_ref = planar_motion(rng, RATE, 4000, postures=12)
    q, tau = planar_record(base, theta, q_ref, RATE, rng, encoder_noise=1e-5)
    tau = tau + 0.05 * rng.standard_normal(tau.shape)
    recording = Recording("run", base.robot.joint_names, q, tau, RATE, q_ref=q_ref)
    return Problem(base.robot, (recording,), Loop(LAW))


def dense(found):
    """Φ, Z and τ of the equations as an estimator of one's own has them, rows in use, weighted."""
    phi, z, tau = [], [], []
    for block in found.equations.blocks():
        for rows in block.joints:
            own, used = np.zeros((rows.tau.size, found.theta.size)), rows.used
            other = own.copy()
            own[:, rows.columns], other[:, rows.columns] = rows.phi.T, rows.z.T
            phi.append(own[used]), z.append(other[used]), tau.append(rows.tau[used])
    return np.concatenate(phi), np.concatenate(z), np.concatenate(tau)


def scaled(phi):
    return np.linalg.norm(phi, axis=0)


def close(a, b, scale, tolerance=1e-9):
    """Within 1e-9 of the torque that the parameters make."""
    return np.abs((np.asarray(a) - b) * scale).max() < tolerance * np.abs(b * scale).max()


def test_fixed_least_squares_is_that_of_statsmodels(problem):
    sm = pytest.importorskip("statsmodels.api")
    names, value = problem.names, {problem.names[0]: 1.9, problem.names[3]: 0.4}
    found = identify(replace(problem, fixed=value), FULL)
    phi, _, tau = dense(found)
    free = [k for k, n in enumerate(names) if n not in value]
    fixed = [k for k, n in enumerate(names) if n in value]
    rest = tau - phi[:, fixed] @ np.array([value[names[k]] for k in fixed])
    expected = sm.OLS(rest, phi[:, free]).fit()
    assert close(found.theta[free], expected.params, scaled(phi)[free])
    own = np.linalg.inv(phi[:, free].T @ phi[:, free])
    assert np.allclose(found.formula_covariance[np.ix_(free, free)], own, rtol=1e-8, atol=0.0)
    assert (found.theta[fixed] == list(value.values())).all()
    for covariance in (found.covariance, found.robust_covariance, found.formula_covariance):
        assert (covariance[fixed] == 0.0).all() and (covariance[:, fixed] == 0.0).all()
    assert (found.std[free] > 0.0).all()


def test_constrained_least_squares_is_that_of_statsmodels(problem):
    sm = pytest.importorskip("statsmodels.api")
    names = problem.names
    equations = [({names[0]: 1.0, names[1]: -2.0}, 0.3), ({names[2]: 1.0, names[0]: 0.5}, 1.0)]
    found = identify(replace(problem, constraints=equations), FULL)
    phi, _, tau = dense(found)
    size = scaled(phi)
    matrix = np.zeros((2, len(names)))
    matrix[0, :2], matrix[1, [0, 2]] = [1.0, -2.0], [0.5, 1.0]
    model = sm.GLM(tau, phi / size).fit_constrained((matrix / size, np.array([0.3, 1.0])))
    assert close(found.theta, model.params / size, size)
    own = model.cov_params() / model.scale / np.outer(size, size)
    assert np.abs((found.formula_covariance - own) * np.outer(size, size)).max() < 1e-8
    assert np.allclose(matrix @ found.theta, [0.3, 1.0], rtol=0.0, atol=1e-12)
    bread = found.restrictions.freedom.basis
    assert np.linalg.matrix_rank(found.robust_covariance) == bread.shape[1] == len(names) - 2


def test_bounded_least_squares_is_the_quadratic_program(problem):
    names = problem.names
    free = identify(problem, FULL)
    shift = 3.0 * free.method_std
    bounds = {
        names[0]: (None, free.theta[0] - shift[0]),
        names[2]: (free.theta[2] + shift[2], None),
        names[4]: (free.theta[4] - 9.0 * shift[4], free.theta[4] + 9.0 * shift[4]),
    }
    found = identify(replace(problem, bounds=bounds), FULL)
    phi, _, tau = dense(found)
    size = scaled(phi)
    low, high = found.restrictions.low, found.restrictions.high
    expected = lsq_linear(phi / size, tau, (low * size, high * size), method="bvls", tol=1e-14).x
    assert close(found.theta, expected / size, size)
    assert found.bound_sides[0] == "high" and found.bound_sides[2] == "low"
    assert not any(found.bound_sides[k] for k in (1, 3, 4))
    ends = found.conf_int()
    assert ends[0, 1] == found.theta[0] and ends[2, 0] == found.theta[2]
    assert ends[0, 0] < found.theta[0] and found.std[0] > 0.0


def test_bounds_and_equations_together_are_the_quadratic_program(problem):
    names = problem.names
    free = identify(problem, FULL)
    limit = free.theta[1] + 4.0 * free.method_std[1]
    known = replace(
        problem,
        constraints=[Equality({names[0]: 1.0, names[1]: 1.0}, free.theta[:2].sum() + 0.01)],
        bounds={names[1]: (limit, None), names[5]: (0.0, 0.5 * free.theta[5])},
    )
    found = identify(known, FULL)
    phi, _, tau = dense(found)
    size = scaled(phi)
    triangle = np.linalg.qr(np.column_stack([phi / size, tau]), mode="r")
    r, y = triangle[: len(names), :-1], triangle[: len(names), -1]
    low, high = np.full((2, len(names)), [[-np.inf], [np.inf]])
    low[1], low[5], high[5] = limit * size[1], 0.0, 0.5 * free.theta[5] * size[5]
    row = np.zeros(len(names))
    row[:2] = 1.0 / size[:2]
    row, value = row * size[0], known.constraints[0].value * size[0]
    made = minimize(
        lambda z: 0.5 * np.sum((r @ z - y) ** 2),
        found.theta * size * 1.001,
        jac=lambda z: r.T @ (r @ z - y),
        hess=lambda z: r.T @ r,
        method="trust-constr",
        bounds=list(zip(low, high, strict=True)),
        constraints=LinearConstraint(row, value, value),
        options={"gtol": 1e-12, "xtol": 1e-14, "maxiter": 5000, "barrier_tol": 1e-14},
    )
    assert np.sum((r @ (found.theta * size) - y) ** 2) <= 2.0 * made.fun * (1.0 + 1e-9)
    assert close(found.theta, made.x / size, size, 1e-5)  # as near as that algorithm comes
    # the bounds that hold, as equations: the exact solution, if each of them pushes inwards
    held = [k for k, side in enumerate(found.bound_sides) if side]
    assert held
    ends = [low[k] if found.bound_sides[k] == "low" else high[k] for k in held]
    rows = np.vstack([row, np.eye(len(names))[held]])
    optimum = np.block([[r.T @ r, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    exact = np.linalg.solve(optimum, np.r_[r.T @ y, value, ends])
    assert close(found.theta, exact[: len(names)] / size, size)
    for k, push in zip(held, exact[len(names) + 1 :], strict=True):
        assert push < 0.0 if found.bound_sides[k] == "low" else push > 0.0
    assert np.all(exact[: len(names)] >= low - 1e-9) and np.all(exact[: len(names)] <= high + 1e-9)


def test_a_prior_is_a_further_measurement(problem):
    names = problem.names
    covariance = np.array([[0.04, 0.01], [0.01, 0.09]]) * 1e-4
    prior = Prior((names[1], names[0]), np.array([0.3, 2.0]), covariance)
    found = identify(replace(problem, priors=prior), FULL)
    phi, _, tau = dense(found)
    rows = np.zeros((2, len(names)))
    rows[0, 1], rows[1, 0] = 1.0, 1.0
    half = np.linalg.inv(np.linalg.cholesky(covariance))
    whole, right = np.vstack([phi, half @ rows]), np.append(tau, half @ [0.3, 2.0])
    expected = np.linalg.lstsq(whole / scaled(phi), right, rcond=None)[0] / scaled(phi)
    assert close(found.theta, expected, scaled(phi))
    own = np.linalg.inv(whole.T @ whole)
    assert np.allclose(found.formula_covariance, own, rtol=1e-8)
    firm = identify(replace(problem, priors={names[0]: (2.0, 1e-9)}), FULL)
    fixed = identify(replace(problem, fixed={names[0]: 2.0}), FULL)
    assert np.allclose(firm.theta, fixed.theta, atol=1e-6)
    assert np.allclose(firm.std[1:], fixed.std[1:], rtol=1e-3)
    assert firm.std[0] == pytest.approx(1e-9, rel=1e-3)


@pytest.mark.parametrize("method", [IV, "piv"])
def test_fixed_instrumental_variables_are_those_of_linearmodels(problem, method):
    iv = pytest.importorskip("linearmodels.iv")
    names = problem.names
    value = {names[0]: 1.95, names[4]: 3.0}
    found = identify(replace(problem, fixed=value), method)
    phi, z, tau = dense(found)
    size = scaled(phi)
    free = [k for k, n in enumerate(names) if n not in value]
    fixed = [k for k, n in enumerate(names) if n in value]
    rest = tau - phi[:, fixed] @ list(value.values())
    scale = size[free]
    columns = phi[:, free] / scale, z[:, free] / scale
    made = iv.IV2SLS(rest, None, *columns).fit(cov_type="unadjusted")
    expected = np.asarray(made.params) / scale
    # the weights of the equations are those of the last residual, the estimate's one before
    assert close(found.theta[free], expected, scale, 1e-5)
    equations = found.equations
    sums = accumulate(equations.regressor, equations.records, equations.filters)
    again = solve(sums, equations.variance, found.restrictions)
    assert close(again.theta[free], expected, scale)
    own = np.linalg.inv(z[:, free].T @ z[:, free])
    assert np.allclose(again.covariance[np.ix_(free, free)], own, rtol=1e-7, atol=0.0)
    assert (found.std[fixed] == 0.0).all() and (found.std[free] > 0.0).all()
    assert found.converged


def test_bounded_instrumental_variables_meet_complementarity(problem):
    names = problem.names
    free = identify(problem, IV)
    shift = 4.0 * free.method_std
    bounds = {names[k]: (free.theta[k] + shift[k], None) for k in (0, 3, 5)}
    bounds |= {names[1]: (None, free.theta[1] - shift[1])}
    found = identify(replace(problem, bounds=bounds), IV)
    phi, z, tau = dense(found)
    force = z.T @ (phi @ found.theta - tau)
    size = scaled(phi)
    for k, side in enumerate(found.bound_sides):
        if side:
            assert force[k] * (1.0 if side == "low" else -1.0) > 0.0
        else:
            assert abs(force[k]) < 1e-9 * np.abs(z).T[k] @ np.abs(tau)
            low, high = found.known.bounds.get(names[k], (-np.inf, np.inf))
            assert low <= found.theta[k] <= high
    held = [k for k, side in enumerate(found.bound_sides) if side]
    assert held
    again = replace(problem, fixed={names[k]: found.theta[k] for k in held})
    assert close(found.theta, identify(again, IV).theta, size, 1e-6)


def test_bounds_are_those_of_a_quadratic_program_for_random_equations():
    rng = np.random.default_rng(0)
    for _ in range(200):
        n = int(rng.integers(2, 12))
        phi, tau = rng.normal(size=(40, n)), rng.normal(size=40)
        low, high = -rng.random(n) * 0.1, rng.random(n) * 0.1
        known = replace(Restrictions.none([f"p{k}" for k in range(n)]), low=low, high=high)
        theta = known.solve(phi.T @ phi, phi.T @ tau)
        expected = lsq_linear(phi, tau, (low, high), method="bvls", tol=1e-15).x
        assert np.allclose(theta, expected, atol=1e-9)


def test_nothing_known_changes_nothing():
    rng = np.random.default_rng(4)
    from tests.estimation.test_normal_equations import JointSums, two_joints

    _, columns, data = two_joints(rng)
    sums = []
    for c, (phi, z, tau) in zip(columns, data, strict=True):
        sums.append(JointSums.empty("a", c))
        sums[-1].add(phi, z, tau, None)
    names = ["a", "b", "c"]
    one, other = solve(sums, np.ones(2), names), solve(sums, np.ones(2), Restrictions.none(names))
    assert (one.theta == other.theta).all() and (one.covariance == other.covariance).all()


def test_the_description_knows_what_is_left_out(problem):
    chosen = problem.names[3:]
    left_out = identify(replace(problem, parameters=chosen), FULL)
    said = [w for w in left_out.warnings if w.kind == "taken as zero"]
    assert len(said) == 1 and problem.names[0] in said[0].message
    known = identify(replace(problem, parameters=chosen, fixed="description"), FULL)
    assert not [w for w in known.warnings if w.kind == "taken as zero"]
    values = problem.base.values(nominal_values(problem.robot, problem.base.standard))
    expected = [n for n, x in zip(problem.names, values, strict=True) if x or n in chosen]
    assert list(known.names) == expected
    assert np.array_equal(known.theta[:2], values[:2]) and (known.std[:2] == 0.0).all()
    assert known.relative_error < 0.5 * left_out.relative_error


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"fixed": {"zz9": 1.0}}, "no base parameter 'zz9'"),
        ({"fixed": {"zz1": np.nan}}, "finite"),
        ({"fixed": "descrption"}, "description"),
        ({"fixed": "description"}, "name the parameters"),
        ({"fixed": {"zz1": 1.0, "zz1r": 1.0}}, "given twice"),
        ({"bounds": {"zz1": (2.0, 1.0)}}, "bounds of zz1"),
        ({"bounds": {"zz1": 2.0}}, "bounds of zz1"),
        ({"bounds": {"zz1": (0.0, 1.0)}, "fixed": {"zz1": 2.0}}, "beyond its bounds"),
        ({"priors": {"zz1": (1.0, 0.0)}}, "not positive definite"),
        ({"priors": {"zz1": 1.0}}, "standard deviation"),
        ({"priors": Prior(("zz1", "zz2"), np.zeros(2), np.ones((2, 2)))}, "positive definite"),
        ({"priors": Prior(("zz1", "zz2"), np.zeros(3), np.eye(2))}, "shape"),
        ({"constraints": [({"zz1": 1.0}, 1.0), ({"zz1": 2.0}, 3.0)]}, "contradicts"),
        ({"constraints": [({"zz1": 1.0}, 1.0), ({"zz1": 2.0}, 2.0)]}, "follows from"),
        ({"constraints": [({"zz1": 0.0}, 1.0)]}, "no coefficient"),
        ({"constraints": [("zz1", 1.0)]}, "constraint"),
        ({"constraints": "zz1 = 2"}, "no list"),
        (
            {
                "constraints": [({"zz1": 1.0, "zz2": 1.0}, 9.0)],
                "bounds": {"zz1": (0, 1), "zz2": (0, 1)},
            },
            "within the bounds",
        ),
        ({"parameters": ("fv1", "fv2"), "bounds": {"zz1": (0, 1)}}, "not among the parameters"),
        ({"parameters": ("fv1",), "fixed": {"fv1": 1.0}}, "nothing is left"),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_refused(problem, given, words):
    with pytest.raises(ExperimentError, match=words):
        replace(problem, **given)


@pytest.fixture(scope="module")
def known(problem):
    """Something of each kind, with a result."""
    names = problem.names
    _, theta = nominal_parameters()
    return replace(
        problem,
        fixed={names[0]: theta[0]},
        bounds={names[4]: (0.0, None)},
        priors={names[1]: (theta[1], 0.1)},
        constraints=[({names[6]: 1.0, names[9]: -2.0}, theta[6] - 2.0 * theta[9])],
    )


def test_a_stored_result_knows_what_was_known(known, tmp_path):
    found = identify(known, "piv")
    found.save(tmp_path)
    back = load_identification(tmp_path)
    assert back.known.fixed == found.known.fixed and back.known.bounds == found.known.bounds
    assert back.known.constraints == found.known.constraints
    assert np.array_equal(back.known.priors[0].covariance, [[0.1**2]])
    assert np.array_equal(back.restrictions.matrix, found.restrictions.matrix)
    text = found.summary()
    assert "fixed" in text and "Bounds: fc1 ≥ 0." in text and "Constraints: 1 zz2 - 2 ia2" in text
    assert "Expected beforehand (2σ): mx1r = 1.8 ± 0.2." in text
    assert back.summary().splitlines()[2:5] == text.splitlines()[2:5]


def test_held_out_motion_is_judged_with_what_is_known(known):
    judged = cross_validate(known, "piv", folds=3)
    for stretch in judged.held_out:
        theta = stretch.identification.theta
        assert theta[0] == known.fixed[known.names[0]]
        assert theta[6] - 2.0 * theta[9] == pytest.approx(known.constraints[0].value, abs=1e-12)
    assert judged.prediction.total_in_band < 3.0


@pytest.mark.parametrize("name", ["cloe", "didim", "irls", "ridge", "map", "ml-ls", "tls"])
def test_other_methods_keep_what_is_fixed(problem, name):
    _, theta = nominal_parameters()
    fixed = {problem.names[0]: theta[0], problem.names[6]: theta[6]}
    found = identify(replace(problem, fixed=fixed), name)
    assert (found.theta[[0, 6]] == theta[[0, 6]]).all() and (found.std[[0, 6]] == 0.0).all()
    free = np.delete(np.arange(13), [0, 6])
    assert (found.std[free] > 0.0).all()
    assert found.value("mx1") == pytest.approx(theta[1], rel=0.02)
    assert not [w for w in found.warnings if w.kind == "undetermined"]


def test_what_a_method_does_not_take_is_refused(problem):
    with pytest.raises(ExperimentError, match="bounds of parameters, which"):
        identify(replace(problem, bounds={"zz1": (0.0, None)}), "irls")


def test_essential_parameters_leave_what_is_fixed(problem):
    fixed = {"zz1": 0.864, "my2": 0.0001}
    found = essential_parameters(replace(problem, fixed=fixed), "iv-full-rate")
    assert found.identification.value("my2") == 0.0001
    assert "my1" in [step.name for step in found.steps]


def test_intervals_cover_the_truth_with_three_known_parameters():
    """Short form of ``benchmarks.coverage_of_parameters piv --fixed zz1r ia3 fv1``.

    Intervals that are too narrow by a fifth or too wide by a quarter do not pass.
    """
    runs = runs_of(PIV, "fine", range(6), ("zz1r", "ia3", "fv1"))
    assert runs.errors.shape == (6, 25)
    assert 0.90 < runs.covered.mean() < 0.99
    assert 0.8 < np.sqrt(np.mean((runs.errors / runs.std) ** 2)) < 1.15
