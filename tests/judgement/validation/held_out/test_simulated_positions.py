"""Simulated positions on motion that was not fitted, and which estimate they let be taken."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pivident.dynamics.forward import make_model
from pivident.dynamics.regressor import Regressor
from pivident.estimation.methods import METHODS
from pivident.estimation.simulation_result import LoopParameter
from pivident.foundation.codec import decode
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.plain_values import plain
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.held_out.held_out_errors import HeldOutErrors
from pivident.judgement.validation.held_out.out_of_sample import _judged
from pivident.judgement.validation.held_out.prediction import Judge, SimulationError, pooled
from pivident.judgement.validation.held_out.replay import OpenLoop, Replay
from pivident.loop.simulation.closed_loop import simulate
from pivident.loop.simulation.controllers import PD
from tests.planar_simulations import (
    SIMULATIONS,
    planar_problem,
    simulated_diagnostics,
    simulated_results,
)


def with_loop(result, **values):
    """A result whose fit found other loop parameters."""
    own = tuple(LoopParameter(name, "", value, 0.0) for name, value in values.items())
    return replace(result, simulation=replace(result.simulation, loop_parameters=own))


def test_a_closed_loop_is_simulated_with_the_gains_of_the_fit():
    """Against the same law with these gains, simulated by hand."""
    problem = planar_problem()
    result = with_loop(simulated_results()["cloe"], kp1=5500.0, kp2=2600.0)
    judge = Judge(problem.recordings[0])
    replay = Replay(problem, judge)
    (error,) = replay.score(result, [slice(1000, 4000)])
    law = PD(kp=[5500.0, 2600.0], kd=[180.0, 60.0])
    model = make_model(problem.robot, problem.regressor.parameters, result.theta)
    signals, start = replay.auxiliary.signals[0]
    made = simulate(model, law, signals, problem.robot.joint_names, start)
    by_hand = made.q[1000:4000] - problem.recordings[0].q[1000:4000]
    np.testing.assert_allclose(error.position, np.sqrt(np.mean(by_hand**2, axis=0)), rtol=1e-9)
    (declared,) = replay.score(simulated_results()["piv"], [slice(1000, 4000)])
    assert (error.position > 10.0 * declared.position).all()


def test_an_encoder_offset_of_the_fit_is_part_of_what_is_compared():
    """A law that reads an offset holds the joint beside the reference; encoders show it there."""
    problem = planar_problem()
    judge = Judge(problem.recordings[0])
    spans = [slice(1000, 4000)]
    plain = Replay(problem, judge).score(simulated_results()["piv"], spans)[0]
    moved = with_loop(simulated_results()["cloe"], encoder_offset1=1e-3)
    shown = Replay(problem, judge).score(moved, spans)[0]
    # the reading follows the reference as before; gravity and friction act at another place only
    assert shown.position[0] < 1e-4 and shown.position[0] > plain.position[0]


def test_an_open_loop_follows_the_equations_of_motion():
    """Against scipy on M ddq = τ - c with the recorded torques, each held over its period."""
    problem = planar_problem()
    recording = problem.recordings[0]
    judge = Judge(recording)
    result = replace(simulated_results()["oloe"], method_used=METHODS["oloe"])
    span = slice(1500, 1800)
    (error,) = OpenLoop(problem, judge).score(result, [span])
    regressor = Regressor.build(problem.robot, problem.regressor.parameters)

    def rates(tau):
        def f(t, state):
            q, dq = state[:2], state[2:]
            bias, *columns = (
                regressor.torque(q[None], dq[None], ddq[None], result.theta)[0]
                for ddq in (np.zeros(2), *np.eye(2))
            )
            mass = np.column_stack([c - bias for c in columns])
            return np.concatenate([dq, np.linalg.solve(mass, tau - bias)])

        return f

    state = np.concatenate([judge.kinematics.q[:, 1500], judge.kinematics.dq[:, 1500]])
    made = [state[:2]]
    for tau in recording.tau[1500:1799]:
        state = solve_ivp(rates(tau), (0.0, 1e-3), state, rtol=1e-9, atol=1e-11).y[:, -1]
        made.append(state[:2])
    by_hand = np.sqrt(np.mean((np.array(made) - recording.q[span]) ** 2, axis=0))
    np.testing.assert_allclose(error.position, by_hand, rtol=0.02)
    assert error.loop == "open" and error.samples == 300


def test_stretches_are_pooled_by_their_samples():
    a, b = (
        SimulationError("closed", ("a",), ("rad",), np.array([x]), n)
        for x, n in ((3.0, 10), (1.0, 30))
    )
    assert pooled([a, b]).position[0] == pytest.approx(np.sqrt((90.0 + 30.0) / 40.0))


def test_every_method_with_a_loop_has_held_out_positions():
    compared = simulated_diagnostics().out_of_sample
    loops = {name: r.simulation.loop for name, r in compared.results.items()}
    assert loops == {"piv": "closed", "cloe": "closed", "ml": "closed", "oloe": "open"}
    table = compared.position_table().text()
    assert "OLOE, open loop" in table and "rad" in table and table in str(compared)
    closed = compared.results["piv"]
    assert (closed.simulation.position == closed.replay.position).all()
    # 2e-6 rad is the noise of the encoders: the loop of the record is known
    assert (closed.simulation.position < 3e-6).all()
    stored = HeldOutErrors.of(compared.results["oloe"])
    assert decode(HeldOutErrors, plain(stored)) == stored
    assert stored.loop == "open" and stored.position_units == {"shoulder": "rad", "elbow": "rad"}
    old = {
        k: v for k, v in plain(stored).items()
        if k not in ("loop", "positions", "position_units")
    }  # fmt: skip
    assert decode(HeldOutErrors, old).positions == {}


def test_without_a_loop_and_without_a_reference_nothing_is_simulated():
    problem = planar_problem()
    virtual = replace(problem, loop=replace(problem.loop, reference="smoothed"))
    for own in (virtual, replace(problem, loop=None)):
        assert cross_validate(own, "ls", folds=2).simulation is None


def judged(factor, name="ml", rivals=("piv",), **changes):
    """The comparison where the fitted simulation has other errors, or another result."""
    results = dict(simulated_diagnostics().out_of_sample.results)
    own = results[name]
    held_out = tuple(
        replace(
            h,
            prediction=replace(
                h.prediction,
                rms_in_band=factor * results["piv"].held_out[k].prediction.rms_in_band,
                torque_in_band=results["piv"].held_out[k].prediction.torque_in_band,
            ),
        )
        for k, h in enumerate(own.held_out)
    )
    changed = replace(own, held_out=held_out, identification=replace(own.identification, **changes))
    chosen = {**{n: results[n] for n in rivals}, name: changed}
    return _judged({n: SIMULATIONS[n] for n in chosen}, chosen, {})


def warned(topic, kind):
    return (Finding("warning", topic, kind, "It does not fit."),)


def test_a_fitted_simulation_is_taken_where_it_predicts_no_worse():
    taken = judged(0.99)
    assert taken.recommended == "ml" and taken.rival == "piv"
    assert "take the estimate of ML" in " ".join(taken.sentences())


def test_it_is_not_taken_where_its_error_is_larger():
    kept = judged(1.01)
    assert kept.recommended == "piv"
    assert "ML is not the one to take" in " ".join(kept.sentences())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"warnings": warned("simulation", "model error")}, "it shows model error"),
        ({"warnings": warned("law", "wrong gain")}, "it shows a wrong gain"),
        ({"warnings": warned("law", "wrong delay")}, "it shows a wrong delay"),
        ({"converged": False}, "it has not converged"),
    ],
)
def test_what_speaks_against_its_simulation_decides(changes, words):
    kept = judged(0.9, **changes)
    assert kept.recommended == "piv" and kept.best == "ml"
    text = " ".join(kept.sentences())
    assert words in text and "ML, which rests on law" in text


def test_without_noise_models_it_is_not_taken():
    kept = judged(0.9, name="oloe")
    assert kept.recommended == "piv" and "not tested for model error" in str(kept)


def test_alone_it_is_taken():
    alone = judged(1.0, rivals=())
    assert alone.recommended == "ml" and alone.simulated_over_rival is None
