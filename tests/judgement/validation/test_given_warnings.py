"""What `identify` and `cross_validate` say by `logging` and by `warnings`, and what they do not."""

import logging
import re
import warnings
from dataclasses import replace

import numpy as np

import pivident as pv
from pivident.foundation.errors import (
    ConvergenceWarning,
    EstimateWarning,
    FailedFoldWarning,
    FallbackWarning,
    RankWarning,
)
from tests.planar_simulations import planar_problem

LOOP = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]))


def given(work) -> list[warnings.WarningMessage]:
    """Warnings of pivident that a user sees of some work who has set up nothing."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("default")
        work()
    return [w for w in found if issubclass(w.category, EstimateWarning)]


def ramp(turns: int) -> pv.Problem:
    """The elbow turns with one speed, and back again in the last part of the record if it turns."""
    robot, t = pv.load_robot("planar_2r"), np.arange(6000) / 1000.0
    elbow = np.where((t > 4.6) & (turns > 0), 4.6 - (t - 4.6), t)
    reference = np.column_stack([0.5 * np.sin(4.0 * t), 0.5 * elbow - 1.0])
    record = pv.simulate(robot, LOOP, reference, torque=0.05, seed=1)
    return pv.Problem(robot, (record.recording,), LOOP)


def test_what_a_good_result_finds_is_no_warning_of_python():
    results = []
    assert given(lambda: results.append(pv.identify(planar_problem(), "piv"))) == []
    assert results[0].converged


def test_an_iteration_that_does_not_end_warns_once_at_the_line_of_the_user():
    problem, results = planar_problem(), []

    def runs():
        for record in (problem.recordings[0], problem.recordings[0].part(0, 5000)):
            mine = replace(problem, recordings=(record,))
            results.append(pv.identify(mine, pv.PrefilteredIV(max_iterations=1)))

    found = given(runs)
    assert not any(result.converged for result in results)
    assert [(w.category, w.filename) for w in found] == [(ConvergenceWarning, __file__)]
    assert str(found[0].message).startswith("IDIM-PIV did not converge")
    judged = given(lambda: pv.cross_validate(problem, pv.PrefilteredIV(max_iterations=1)))
    assert [(w.category, w.filename) for w in judged] == [(ConvergenceWarning, __file__)]


def test_parameters_left_out_warn():
    results = []
    (found,) = given(lambda: results.append(pv.identify(ramp(0), "ls")))
    assert found.category is RankWarning and "IDIM-WLS left out" in str(found.message)
    assert "off2" not in results[0].names


def test_instruments_that_took_the_place_of_others_warn():
    stiff = pv.Loop(pv.PD([1e7, 1e7], [1e5, 1e5]), reference="smoothed")
    results = []
    problem = replace(planar_problem(), loop=stiff)
    (found,) = given(lambda: results.append(pv.identify(problem, "piv")))
    assert found.category is FallbackWarning and "instruments" in str(found.message)
    assert results[0].instruments.instead_of


def test_a_fold_that_fails_warns():
    results = []
    (found,) = given(lambda: results.append(pv.cross_validate(ramp(1), "ls", folds=2)))
    assert found.category is FailedFoldWarning
    assert len(results[0].failures) == 1


def test_stages_are_logged_with_their_time_and_iterations_in_detail(caplog):
    lines = []
    with caplog.at_level(logging.DEBUG, logger="pivident"):
        result = pv.identify(planar_problem(), "piv", lines.append)
    records = [r for r in caplog.records if r.name == "pivident"]
    ended = [r.getMessage() for r in records if r.levelno == logging.INFO]
    *stages, last = ended
    assert all(re.fullmatch(r"IDIM-PIV: [\w ]+: \d+\.\d\d s", line) for line in stages)
    assert [line.split(": ")[1] for line in stages] == [
        "smoothing the records", "iterating", "residuals and covariance",
    ]  # fmt: skip
    assert last.startswith(f"IDIM-PIV: converged, {result.iterations} passes; ")
    spent = [float(re.search(r"([\d.]+) s$", line)[1]) for line in ended]
    assert sum(spent[:-1]) <= spent[-1] + 0.02  # two decimals each
    details = [r.getMessage() for r in records if r.levelno == logging.DEBUG]
    assert details == lines  # once each
    assert sum(line.startswith("iteration ") for line in details) == result.iterations


def test_a_cross_validation_logs_each_line_once(caplog):
    with caplog.at_level(logging.DEBUG, logger="pivident"):
        pv.cross_validate(planar_problem(), "ls", folds=3)
    details = [r.getMessage() for r in caplog.records if r.levelno == logging.DEBUG]
    assert [d for d in details if d.startswith("fold")] == [f"fold {k} of 3" for k in (1, 2, 3)]
    assert details.count("IDIM-WLS: filtering the records") == 1


def test_nothing_is_printed_without_logging(capfd):
    pv.identify(planar_problem(), "ls")
    assert capfd.readouterr() == ("", "")
