"""The open-loop protocol of benchmarks/emps_leaderboard.py: score, initial state, choice."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks import emps_leaderboard as leaderboard
from benchmarks.emps_laws import TWO_SLOPES, Candidate, laws
from benchmarks.open_loop_fit import GIVEN, Stretch, fit_open_loop, rms
from scipy.integrate import solve_ivp

from pivident.data.recording.recording import Recording

GAIN, RATE = 35.15, 1000.0
TRUTH = {"m1": 95.0, "fvp1": 150.0, "fvn1": 230.0, "fc1": 21.0, "off1": -3.0}


def drive_input(samples):
    """Steps of both signs that keep the carriage on the rail [V]."""
    t = np.arange(samples) / RATE
    return 3.0 * np.sin(2.0 * np.pi * 3.1 * t) + 1.5 * np.sign(np.sin(2.0 * np.pi * 1.1 * t))


def carriage(t, state, force):
    """Motion with two slopes, Coulomb friction and an offset: the law, written a second time."""
    v = state[1]
    slope = TRUTH["fvp1"] if v > 0.0 else TRUTH["fvn1"]
    dry = TRUTH["fc1"] * 2.0 / np.pi * np.arctan(2000.0 * v) + TRUTH["off1"]
    return [v, (force - slope * v - dry) / TRUTH["m1"]]


@pytest.fixture(scope="module")
def simulated():
    """A record of the true carriage by an independent integrator, the input held each sample."""
    u, state, q = drive_input(1500), np.array([0.05, 0.02]), []
    for force in GAIN * u:
        q.append(state[0])
        answer = solve_ivp(
            carriage, (0.0, 1.0 / RATE), state, args=(force,), rtol=1e-8, atol=1e-11, method="LSODA"
        )
        state = answer.y[:, -1]
    return Recording(
        name="simulated", joint_names=("carriage",), rate=RATE, q=np.array(q)[:, None],
        tau=(GAIN * u)[:, None], torque_timing="held",
    )  # fmt: skip


@pytest.fixture(scope="module")
def law():
    """Two slopes with the smooth sign of the truth."""
    terms = (replace(t, gamma=2000.0, smoothing="atan") if t.has_sign else t for t in TWO_SLOPES)
    return Candidate("true law", tuple(terms))


def model_of(law, **values):
    return replace(law.model(TRUTH | values), drive_gain=GAIN)


def test_the_truth_scores_nothing_from_the_state_of_the_first_samples(simulated, law):
    whole, model = Stretch(0, 1500), model_of(law)
    assert model.score(simulated, whole) < 0.02  # mm, of 100 mm
    ((position, speed),) = model.starts(model.loop(simulated), simulated, [whole])
    assert position[0] == pytest.approx(0.05, abs=1e-6)
    assert speed[0] == pytest.approx(0.02, abs=1e-4)
    assert model_of(law, fc1=21.5).score(simulated, whole) > 0.1


def test_the_score_leaves_the_given_samples_out_and_counts_millimetres(simulated, law):
    whole, model = Stretch(0, 1500), model_of(law, fc1=22.0)
    errors = model.errors(simulated, whole)
    assert GIVEN == 20
    assert model.score(simulated, whole) == rms(errors[20:]) != rms(errors)
    later = simulated.q.copy()
    later[20:] += 1e-3
    moved = replace(simulated, q=later)
    np.testing.assert_allclose(model.errors(moved, whole)[20:], errors[20:] - 1.0, atol=1e-9)


def test_a_later_position_never_reaches_the_simulation(simulated, law):
    """What is simulated depends on the input and on 20 positions alone."""
    model, whole = model_of(law), Stretch(0, 1500)
    blind = simulated.q.copy()
    blind[GIVEN:] = 0.0
    hidden = replace(simulated, q=blind)
    ours = model.errors(simulated, whole) + 1e3 * simulated.q[:, 0]
    theirs = model.errors(hidden, whole) + 1e3 * blind[:, 0]
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_derivatives_contain_the_initial_state_of_each_stretch(simulated, law):
    parts, model = [Stretch(0, 700), Stretch(800, 1500)], model_of(law)
    _, columns, _ = model.linearised(simulated, parts)
    for k, name in enumerate(model.names):
        step = 1e-4 * abs(TRUTH[name])
        ahead, behind = (
            np.concatenate([moved.errors(simulated, own) for own in parts])
            for moved in (model_of(law, **{name: TRUTH[name] + s * step}) for s in (1.0, -1.0))
        )
        slope = (ahead - behind) / (2.0 * step)
        assert np.abs(columns[:, k] - slope).max() < 1e-3 * np.abs(slope).max()


def test_a_carriage_at_rest_keeps_the_speed_that_its_positions_leave_open(simulated, law):
    """Encoder noise of a carriage that sticks must not become a speed."""
    stuck = Candidate("sharp sign", TWO_SLOPES)
    rng = np.random.default_rng(1)
    noise = 1e-6 * rng.normal(size=simulated.q.shape)
    still = replace(simulated, q=noise, tau=0.01 * simulated.tau)
    model = model_of(stuck)
    ((_, speed),) = model.starts(model.loop(still), still, [Stretch(0, 100)])
    assert abs(speed[0]) < 1e-3


def test_a_fit_finds_the_truth_within_its_intervals(simulated, law):
    rng = np.random.default_rng(3)
    noisy = replace(simulated, q=simulated.q + 1e-6 * rng.normal(size=simulated.q.shape))
    start = replace(law.model(), drive_gain=GAIN)
    parts = [Stretch(k, k + 150) for k in range(0, 1500, 150)]
    found = fit_open_loop(start, noisy, parts)
    for name, truth in TRUTH.items():
        width = found.high[name] - found.low[name]
        assert 0.0 < width < 0.5 * abs(truth)
        assert abs(found.model.values[name] - truth) < width
    assert len(found.without) == 10
    whole = Stretch(0, 1500)
    assert 0.0 < found.model.score(noisy, whole) < 5.0 * found.expected_error(noisy, whole)


@pytest.mark.parametrize("candidate", laws(), ids=lambda own: own.title)
def test_half_the_step_moves_no_law_by_two_micrometres(simulated, candidate):
    """Bristles of 5 µm and a sign of 25 µm/s pass within a sampling period, which covers 0.1 mm."""
    model = model_of(candidate, fv1=190.0, fs1=3.0, fvx1=15.0, fma1=7.0, fmb1=7.0, fmc1=7.0)
    whole = Stretch(0, 1500)
    change = model.errors(simulated, whole, finer=2) - model.errors(simulated, whole)
    assert np.abs(change).max() < 2e-3


@pytest.fixture(scope="module")
def trapezia():
    """Moves to and fro from rest to rest at two speeds, twice, as references alone."""
    move = np.interp(np.arange(300), [0, 50, 250, 300], [0.0, 1.0, 1.0, 0.0])
    speeds = np.concatenate([peak * move for peak in (0.04, 0.12, -0.04, -0.12)] * 2)
    reference = np.cumsum(speeds)[:, None] / RATE
    return Recording(
        name="moves", joint_names=("carriage",), rate=RATE, q=reference, q_ref=reference,
        tau=reference, torque_timing="held",
    )  # fmt: skip


def test_moves_cover_the_record_once_and_kinds_are_speeds_with_direction(trapezia):
    moves = leaderboard.moves_of(trapezia)
    assert np.concatenate([np.arange(*own) for own in moves]).tolist() == list(range(2400))
    assert [own.start for own in moves] == pytest.approx(list(range(0, 2400, 300)), abs=2)
    assert leaderboard.kinds_of(trapezia, moves) == [[3, 7], [2, 6], [0, 4], [1, 5]]
    assert leaderboard.connected([moves[0], moves[1], moves[3]]) == [
        Stretch(0, moves[1].stop), moves[3],
    ]  # fmt: skip


def test_a_kind_that_is_left_out_is_in_no_fit_that_simulates_it(trapezia, law, monkeypatch):
    moves = leaderboard.moves_of(trapezia)
    fits, judged = [], []

    class Model:
        def errors(self, record, own):
            judged.append((len(fits) - 1, own))
            return np.ones(own.stop - own.start)

    def fitted(candidate, record, parts, kinds=None):
        fits.append(list(parts))
        return type("Fit", (), {"model": Model()})()

    monkeypatch.setattr(leaderboard, "fitted", fitted)
    monkeypatch.setattr(leaderboard, "refusal", lambda *given: "")
    trial = leaderboard.tried(law, trapezia)
    assert sorted(own for _, own in judged) == sorted(moves)
    assert all(own not in fits[k] for k, own in judged)
    assert fits[-1] == moves
    assert trial.held_out == pytest.approx(1.0)
    assert trial.samples == 2400 - 8 * GIVEN


def trial(squares, terms=TWO_SLOPES, refused=""):
    return leaderboard.Trial(Candidate("", terms), np.array(squares, float), 100, refused)


def test_the_simplest_within_a_standard_error_is_chosen():
    best = trial([1.0, 1.0, 1.0, 1.0])
    close, far = trial([2.0, 0.5, 1.5, 0.8], TWO_SLOPES[:2]), trial([2.0] * 4, TWO_SLOPES[:2])
    assert leaderboard.simplest([best, close]) is close
    assert leaderboard.simplest([best, far]) is best
    better = trial([0.1] * 4, refused="not determined")
    assert leaderboard.simplest([better, best]) is best


def test_laws_are_refused_for_signs_and_for_constants_without_bound(simulated, law, monkeypatch):
    monkeypatch.setattr(leaderboard, "SAME", np.inf)  # beside the truth there are no errors

    def found(own, **changes):
        model = model_of(own, **changes)
        names = dict.fromkeys(model.names, 1.0)
        return leaderboard.OpenLoopFit(model, dict(names), dict(names), (), 1)

    assert leaderboard.refusal(law, found(law), simulated) == ""
    assert "fc" in leaderboard.refusal(law, found(law, fc1=-1.0), simulated)
    free = replace(law, constants=("gamma",))
    wide = found(free, gamma=2000.0)
    wide.high["gamma"] = 6000.0
    assert "gamma" in leaderboard.refusal(free, wide, simulated)
    wide.high["gamma"] = 3000.0
    assert leaderboard.refusal(free, wide, simulated) == ""
    late = replace(law, constants=("delay",))
    model = found(late, delay=1e-3)
    model.low["delay"] = -1e-4
    assert "delay" in leaderboard.refusal(late, model, simulated)


def test_the_choice_opens_no_file(simulated, law, monkeypatch):
    opened = []
    for name in ("load_emps", "load_emps_pulses"):
        monkeypatch.setattr(leaderboard, name, lambda *given: opened.append(given))
    moves = [Stretch(k, k + 250) for k in range(0, 1500, 250)]
    monkeypatch.setattr(leaderboard, "moves_of", lambda record: moves)
    monkeypatch.setattr(leaderboard, "kinds_of", lambda *given: [[0, 3], [1, 4], [2, 5]])
    begin = TRUTH | {"fc1": 22.0, "m1": 96.0}
    monkeypatch.setattr(Candidate, "linear_start", lambda *given: begin)
    monkeypatch.setattr(leaderboard, "refusal", lambda *given: "")
    monkeypatch.setattr(Candidate, "model", lambda own, start=None, make=Candidate.model:
                        replace(make(own, start), drive_gain=GAIN))  # fmt: skip
    chosen, trials = leaderboard.choose(simulated, [law], further=False)
    assert not opened
    assert trials == [chosen]
    assert chosen.held_out < 0.05
