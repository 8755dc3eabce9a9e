"""How long a simulation runs from a measured state: moves, seconds or the record."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks import free_run

import pivident as pv
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.output_error import record_stretches
from pivident.estimation.output_error.output_error import OutputError
from pivident.estimation.output_error.record_stretches import kinds_of_moves, without_moves
from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.controllers import PID
from tests.estimation.output_error.arms import problem
from tests.planar_arm import LAW

OLOE = METHODS["oloe"]


@pytest.fixture(scope="module")
def carriage():
    """A machine with hidden friction and 25 s of it."""
    rng = np.random.default_rng(5)
    machine = free_run.Machine.drawn(rng)
    return machine, pv.Problem(free_run.ROBOT, (machine.record(rng),))


@pytest.fixture(scope="module")
def over_record(carriage):
    return identify(carriage[1], OLOE)


def test_an_axis_in_open_loop_runs_over_the_record_from_its_measured_state(carriage, over_record):
    simulation = over_record.simulation
    (stretch,) = simulation.fit.stretches
    assert stretch.samples == carriage[1].recordings[0].samples
    assert simulation.horizon == pytest.approx(stretch.samples / 1000.0)
    assert over_record.converged
    assert f"driven by the recorded torques over {simulation.horizon:.3g} s" in str(over_record)
    # minutes of errors must not bend the start, which the first samples tell to a micrometre
    q = carriage[1].recordings[0].q
    assert stretch.loop.begin[0] == pytest.approx(q[0], abs=1e-7)
    assert stretch.loop.begin[1] == pytest.approx((q[1] - q[0]) * 1000.0, abs=1e-3)


def test_moves_are_cut_at_rest_and_those_of_one_kind_are_found(over_record):
    stretches = over_record.simulation.fit.stretches
    moves = stretches[0].moves
    assert len(moves) == 1 + 8 * free_run.PERIODS
    speed = np.abs(np.diff(free_run.reference()[:, 0])) * 1000.0
    assert (speed[[k - 1 for k in moves[1:-1]]] < 1e-2).all()  # the carriage lags
    kinds = kinds_of_moves(stretches)
    assert sorted(len(own) for own in kinds) == [4, 4, 4, 4, 8, 8]
    for kind in kinds:
        left = without_moves(stretches, kind)
        gone = sum(moves[place + 1] - moves[place] for _, place in kind)
        assert sum(own.samples for own in left) == moves[-1] - gone
        for piece in left:
            k = round(piece.start_time * 1000.0)
            assert k in moves
            assert piece.loop.begin[0] == pytest.approx(stretches[0].q[k], abs=1e-6)


@pytest.fixture(scope="module")
def outcomes():
    """Both horizons on three machines."""
    return [free_run.judged(seed) for seed in (1, 11, 18)]


def test_intervals_of_a_long_run_hold_what_friction_does_beside_its_law(outcomes):
    """Those of errors that were independent would hold a third of the constants."""
    z = np.abs([own["record"].z for own in outcomes])
    assert np.mean(z < 1.96) > 0.85 and z.max() < 4.0
    assert np.sqrt(np.mean(z**2)) > 0.3


def test_runs_over_the_record_simulate_it_better_than_runs_over_moves(outcomes):
    moves, record = ([own[h].error for own in outcomes] for h in ("moves", "record"))
    assert np.sqrt(np.mean(np.square(record))) < 0.8 * np.sqrt(np.mean(np.square(moves)))


@pytest.mark.parametrize(("horizon", "count"), [("moves", 32), (7.0, 4), ("record", 1)])
def test_a_horizon_cuts_the_record(carriage, horizon, count):
    found = identify(carriage[1], replace(OLOE, horizon=horizon, max_iterations=1))
    assert len(found.simulation.fit.stretches) == count
    longest = max(own.samples for own in found.simulation.fit.stretches)
    assert found.simulation.horizon == pytest.approx(longest / 1000.0)


def test_a_run_that_diverges_begins_shorter_and_grows_again(carriage):
    """From a start without friction the carriage leaves its rail; shorter runs lead back."""
    slippery = {"m1r": 30.0, "fvp1": 1.0, "fvn1": 1.0, "fc1": 0.0, "off1": 0.0}
    two_periods = carriage[1].recordings[0].part(0, 2 * free_run.PERIOD)
    own = replace(carriage[1], recordings=(two_periods,), initial=slippery)
    said = []
    found = identify(own, replace(OLOE, horizon="record", start="initial"), said.append)
    assert any("diverge, begun with half" in str(line) for line in said)
    (stretch,) = found.simulation.fit.stretches
    assert stretch.samples == own.recordings[0].samples
    assert found.simulation.position_rms[0] < 5e-3
    assert not [w for w in found.warnings if w.kind == "short horizon"]


def test_an_open_loop_that_nobody_can_simulate_over_the_record_is_refused():
    """An arm falls away from any motion."""
    own, _ = tx40_scenario("fine", 0)
    refused = r"an error of the initial state.*grows 1000-fold within .* closed loop \(cloe"
    with pytest.raises(ExperimentError, match=refused):
        identify(own, replace(OLOE, horizon="record"))


def test_a_closed_loop_begins_anew_where_its_law_has_no_memory():
    own = problem()
    whole, cut = (identify(own, OutputError("positions", horizon=h)) for h in (None, 1.0))
    assert len(whole.simulation.fit.stretches) == 1 and len(cut.simulation.fit.stretches) == 4
    z = (cut.theta - whole.theta) / np.hypot(cut.std, whole.std)
    assert (np.abs(z) < 4.0).all()
    law = PID(LAW.kp, LAW.kd, ki=[1000.0, 1000.0])
    with pytest.raises(ExperimentError, match=r"begin anew at 1 s.*control law is not known"):
        identify(problem(law=law), OutputError("positions", horizon=1.0))


def test_fewer_kinds_of_moves_than_unknowns_give_variances_alone(
    carriage, over_record, monkeypatch
):
    """The covariance of five estimates has a rank of four, and no inverse of five unknowns."""
    whole = over_record
    monkeypatch.setattr(record_stretches, "MAX_KINDS", 5)
    few = identify(carriage[1], OLOE)
    assert np.linalg.matrix_rank(few.covariance / np.outer(few.std, few.std), tol=1e-9) == 5
    assert (few.std > 0.3 * whole.std).all()
    np.testing.assert_allclose(few.theta, whole.theta)
