"""What the verdict says about fitted simulations."""

from dataclasses import replace

import numpy as np

from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.foundation.text.finding import Finding
from pivident.judgement.diagnostics.estimate_statements import determined, further_warnings
from pivident.judgement.diagnostics.verdict import verdict
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from tests.planar_simulations import planar_problem, simulated_diagnostics, simulated_results


def taken(name):
    """The verdict where this method's estimate is taken."""
    diagnostics = simulated_diagnostics()
    compared = replace(diagnostics.out_of_sample, recommended=name)
    return verdict(replace(diagnostics, out_of_sample=compared))


def test_feedback_does_not_bias_a_simulation_that_is_given_the_reference():
    (closed,) = [s for s in taken("ml").statements if s.topic == "feedback"]
    assert closed.severity == "ok" and "no measured position" in closed.message
    (opened,) = [s for s in taken("oloe").statements if s.topic == "feedback"]
    assert opened.severity == "note" and "recorded torques" in opened.message


def test_noise_models_are_judged_by_what_they_whiten():
    statements = taken("ml").statements
    (own,) = [s for s in statements if s.topic == "simulation" and s.kind in ("white", "coloured")]
    assert "simulation errors" in own.message and "Ljung-Box" in own.basis
    torque = [s for s in statements if s.topic == "noise"]
    assert all("torque residual" in s.message for s in torque)
    assert not any(s.kind == "white" and s.topic == "simulation" for s in taken("oloe").statements)


def test_held_out_positions_are_in_the_verdict():
    (own,) = [s for s in taken("oloe").statements if s.kind == "held out"]
    found = simulated_diagnostics().out_of_sample.results["oloe"].simulation
    assert [q.value for q in own.evidence.values()] == found.position.tolist()
    assert "open loop" in own.message and "rad" in own.message
    assert not any(s.kind == "held out" for s in taken("piv").statements)


def test_a_wrong_gain_is_a_reservation_and_not_the_estimate_to_take():
    law = PD(kp=[6300.0, 2500.0], kd=[180.0, 60.0])  # the record has 6000
    problem = replace(planar_problem(), loop=Loop(law))
    result = identify(problem, METHODS["cloe"])
    found = [w for w in result.warnings if w.topic == "law"]
    assert found
    statements = verdict(result).statements
    assert all(w in statements for w in found)
    assert verdict(result).severity != "ok"


def test_many_wrong_gains_are_one_statement():
    wrong = tuple(
        Finding("warning", "law", "wrong gain", f"kp{j} is wrong.", f"kp{j}") for j in range(1, 7)
    )
    (one,) = further_warnings(replace(simulated_results()["piv"], warnings=wrong))
    assert "6 declared gains" in one.message and "kp1, kp2" in one.message
    few = list(further_warnings(replace(simulated_results()["piv"], warnings=wrong[:2])))
    assert few == list(wrong[:2])


def test_what_was_held_is_not_called_known():
    result = simulated_results()["cloe"]
    held = ("my1", "fv2")
    covariance = result.covariance.copy()
    for name in held:
        k = result.names.index(name)
        covariance[k], covariance[:, k] = 0.0, 0.0
    own = replace(
        result,
        covariance=covariance,
        robust_covariance=covariance,
        simulation=replace(result.simulation, held=held),
    )
    first = next(determined(own))
    assert "held where they were: my1, fv2" in first.message
    well = int(first.evidence["well known"].value)
    known = 2.0 * np.nan_to_num(result.relative_std, posinf=1e9) <= 10.0
    assert well == sum(bool(k) for n, k in zip(result.names, known, strict=True) if n not in held)
