"""A result with fixed parameters is judged, drawn and written as any other: they have no σ."""

import warnings

import numpy as np
import pytest

import pivident as pv
from pivident.dynamics.signs import negative_parameters
from pivident.judgement.validation.residuals.model_error import model_error_by_repetition

LOOP = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]))


def problem(fixed: dict[str, float], repetitions: int = 1) -> pv.Problem:
    """6 s of the planar arm, whose friction and inertia are known in part."""
    robot, t = pv.load_robot("planar_2r"), np.arange(6000) * repetitions / 6000.0
    phase = 2.0 * np.pi * t
    q = np.column_stack([np.sin(phase), np.cos(2.0 * phase) + 0.5 * np.sin(phase)])
    record = pv.simulate(robot, LOOP, 0.6 * q, encoder=2e-5, torque=0.1, seed=1)
    return pv.Problem(robot, (record.recording,), LOOP, fixed=fixed)


@pytest.mark.parametrize("method", ["ls", "piv"])
def test_nothing_divides_by_a_standard_error_that_is_not_there(method, tmp_path):
    mine = problem({"zz1r": 0.864, "fc1": 4.0, "ia2": 0.1})
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        results = {method: pv.identify(mine, method)}
        found = pv.diagnose(mine, results)
        verdict = pv.verdict(found)
        pv.write_report([*results.values()], tmp_path / "report.html", diagnostics=found)
    assert not found.notes and "nan" not in str(verdict).lower()
    assert "could not be written" not in (tmp_path / "report.html").read_text("utf-8")
    assert verdict.headline.startswith("Good for torque prediction")


def test_a_negative_friction_that_was_fixed_is_no_finding():
    mine = problem({"fv1": -0.1})
    result = pv.identify(mine, "ls")
    judged = pv.verdict(pv.diagnose(mine, {"ls": result}))
    assert result.value("fv1") == -0.1
    found = [*judged.statements, *result.warnings]
    assert not [f for f in found if "fv1" in f.advised and "negative" in f.advised.lower()]
    assert not negative_parameters(result.parameters, result.names, result.theta, result.std)


def test_what_noise_alone_makes_is_compared_with_the_parameters_that_vary():
    """The ratio of both kinds of standard errors is that of the parameters that have some."""
    mine = problem({"zz1r": 0.864, "fc1": 4.0}, repetitions=4)
    found = pv.identify(mine, "piv")
    split = model_error_by_repetition(mine, found)
    free = found.std > 0.0
    assert free.sum() == len(found.names) - 2
    ratio = np.exp(np.mean(np.log(found.std[free] / split.repeatability[free])))
    assert f"are {ratio:.2g} times as large" in " ".join(split.sentences())
