"""Records that do not separate all parameters: no method is lost, and one line says what went.

The axes of the arm cross at a right angle, and the file says 16 microradians more: too little for
any torque to show, and enough for the rotor inertia of the second joint to be a parameter of its
own, which no motion separates from the link's.
"""

from dataclasses import replace

import numpy as np
import pytest

from pivident.app.cli.app import main
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.separation import KIND, is_separated, left_out
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.estimation.stored_identification import load_identification
from pivident.experiment.check.experiment_check import check_experiment
from pivident.foundation.errors import RankDeficientRegressor
from pivident.judgement.validation.essential_parameters import essential_parameters
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.urdf import parse_urdf
from tests.robot.test_printed_angles import urdf

RATE = 500.0
METHODS = ("ls", "iv-full-rate", "piv")
EXACT, LEANING = (urdf(quarter, repr(np.pi)) for quarter in (repr(np.pi / 2), "1.570812"))

EXPERIMENT = """
robot = "arm.urdf"

[recording]
files = "log.csv"
columns = {t = "t", q = ["q1", "q2", "q3"], tau = ["tau1", "tau2", "tau3"]}
units = {q = "rad", tau = "N m"}

[identify]
methods = ["ls", "iv-full-rate", "piv"]
essential = true

[validation]
folds = 2

[output]
report = false
"""


@pytest.fixture(scope="module")
def truth():
    """Base parameters of the arm with exact angles, rotors and friction, and their values."""
    base = base_parameters(parse_urdf(EXACT))
    values = nominal_values(base.robot, base.standard)
    chosen = {"ia": 0.4, "fv": 1.0, "fc": 2.0, "off": 0.1}
    for k, p in enumerate(base.standard):
        values[k] = chosen.get(p.stem, values[k])
    return base, base.values(values)


@pytest.fixture(scope="module")
def record(truth):
    base, theta = truth
    rng = np.random.default_rng(4)
    postures = rng.uniform(-0.9, 0.9, (40, 3))
    q, dq, ddq = point_to_point(postures, np.full(3, 1.6), RATE, 6000)
    tau = Regressor.build(base.robot, base.parameters).matrix(q, dq, ddq) @ theta
    tau += 0.2 * rng.standard_normal(q.shape)
    q = q + 1e-6 * rng.standard_normal(q.shape)
    return Recording("run", base.robot.joint_names, q, tau, RATE)


@pytest.fixture(scope="module")
def results(record):
    """Of the file with exact angles and of the leaning one, by method."""
    problems = [Problem(parse_urdf(text), (record,)) for text in (EXACT, LEANING)]
    return {method: [identify(problem, method) for problem in problems] for method in METHODS}


def left_out_by(found):
    return [warning for warning in found.warnings if warning.kind == KIND]


@pytest.mark.parametrize("method", METHODS)
def test_the_estimate_is_that_of_the_exact_file(method, results, truth):
    exact, leaning = results[method]
    assert "ia2" in base_parameters(parse_urdf(LEANING)).names
    heads = [[p.name for p in found.parameters] for found in (exact, leaning)]
    assert heads[0] == heads[1] and not left_out_by(exact)
    assert np.abs((leaning.theta - exact.theta) / exact.std).max() < 0.2
    merged = leaning.names.index("zz2r")
    assert leaning.theta[merged] == pytest.approx(
        truth[1][merged], rel=0.01
    )  # with the rotor's 0.4


@pytest.mark.parametrize("method", METHODS)
def test_one_line_names_what_is_left_out_and_what_holds_its_part(method, results):
    (warning,) = left_out_by(results[method][1])
    assert warning.subject == "ia2" and "ia2 (zz2r holds its part)" in warning.message


def test_essential_parameters_are_found_all_the_same(record):
    found = essential_parameters(Problem(parse_urdf(LEANING), (record,)), "piv")
    assert "ia2" not in found.full.names and "zz2r" in found.names
    assert len(left_out_by(found.identification)) == 1


def test_check_and_identify_say_the_same_and_files_read_back(record, tmp_path, capsys):
    (tmp_path / "arm.urdf").write_text(LEANING, "utf-8")
    (tmp_path / "experiment.toml").write_text(EXPERIMENT, "utf-8")
    rows = np.column_stack([np.arange(record.samples) / RATE, record.q, record.tau])
    header = "t,q1,q2,q3,tau1,tau2,tau3"
    np.savetxt(tmp_path / "log.csv", rows, "%.10g", ",", header=header, comments="")
    remarks = check_experiment(tmp_path / "experiment.toml").remarks
    (remark,) = [remark for remark in remarks if remark.kind == KIND]
    assert remark.severity == "warning" and "No motion" in remark.next_step
    assert "ccelerate" not in remark.next_step
    folder = tmp_path / "results"
    assert main(["identify", str(tmp_path / "experiment.toml"), "--out", str(folder)]) == 0
    assert capsys.readouterr().out.count(remark.message) == 1  # in the verdict
    for method in METHODS:
        found = load_identification(folder / method / "identification.json")
        (warning,) = left_out_by(found)
        assert warning.message == remark.message and "ia2" not in found.names
    for command in (
        ["predict", str(folder / "piv"), str(tmp_path / "log.csv")],
        ["export", str(folder / "piv"), "--to", "numpy", "--out", str(tmp_path / "arm.py")],
    ):
        assert main(command) == 0


def test_a_joint_at_rest_costs_its_friction_only(record):
    """Its torques are gravity and a constant, whatever its friction and rotor are."""
    base = base_parameters(parse_urdf(EXACT))
    q = np.column_stack([record.q[:, :2], np.full(record.samples, 0.3)])
    still = replace(record, q=q, allow_constant=True)
    found = identify(Problem(base.robot, (still,), mask=None), "ls")
    (warning,) = left_out_by(found)
    assert {"fv3", "fc3", "ia3"} <= set(warning.subject.split(", "))
    assert "fv3 (no effect in this motion)" in warning.message


def test_held_out_motion_and_a_replayed_loop_judge_the_smaller_set(record):
    loop = Loop(PD(np.full(3, 4000.0), np.full(3, 150.0)))
    problem = Problem(parse_urdf(LEANING), (replace(record, q_ref=record.q),), loop)
    found = cross_validate(problem, "ls", folds=2)
    assert found.replay is not None and not found.failures
    assert found.prediction.total < 2.0


def gram_of(columns):
    unit = columns / np.linalg.norm(columns, axis=0)
    return unit.T @ unit


def test_a_sum_that_alone_is_seen_is_held_by_what_comes_first():
    rng = np.random.default_rng(0)
    a, b, c, d = rng.standard_normal((4, 500))
    columns = np.column_stack([a, b, a + 2 * b + 1e-5 * d, c])
    torque = np.full(4, 1e4)
    assert left_out(gram_of(columns), torque, [3, 0, 1, 2]) == {2: [1, 0]}  # 2 b is the larger part
    assert {k: set(x) for k, x in left_out(gram_of(columns), torque, [2, 3, 1, 0]).items()} == {
        0: {1, 2}
    }
    assert is_separated(gram_of(columns), np.full(4, 1e7))  # so little noise that it is seen


def test_weak_but_separate_parameters_stay():
    rng = np.random.default_rng(1)
    columns = rng.standard_normal((500, 3)) * [1.0, 1e-9, 1.0]
    assert left_out(gram_of(columns), np.full(3, 10.0), [0, 1, 2]) == {}


def test_an_error_without_evidence_is_raised_as_it_is(record, monkeypatch):
    def refuse(*arguments, **options):
        raise RankDeficientRegressor(2, 3, [("a", "b")])

    monkeypatch.setattr("pivident.estimation.least_squares.LeastSquares.estimate", refuse)
    with pytest.raises(RankDeficientRegressor, match="separates 2 of 3"):
        identify(Problem(parse_urdf(EXACT), (record,)), "ls")
