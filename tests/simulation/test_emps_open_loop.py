"""The open-loop protocol of benchmarks/emps_leaderboard.py: score, initial state, choice."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks import emps_leaderboard as leaderboard
from benchmarks.open_loop_fit import GIVEN, Stretch, fit_open_loop, rms
from scipy.integrate import solve_ivp

from pivident.recording.recording import Recording

GAIN, RATE = 35.15, 1000.0
TRUTH = {"m1": 95.0, "fvp1": 150.0, "fvn1": 230.0, "fcp1": 18.0, "fcn1": 24.0}


def drive_input(samples):
    """Steps of both signs that keep the carriage on the rail [V]."""
    t = np.arange(samples) / RATE
    return 3.0 * np.sin(2.0 * np.pi * 3.1 * t) + 1.5 * np.sign(np.sin(2.0 * np.pi * 1.1 * t))


def carriage(t, state, force):
    """Motion with friction by direction: the law, written a second time."""
    v = state[1]
    s = 2.0 / np.pi * np.arctan(2000.0 * v)
    dry = TRUTH["fcp1"] * (1.0 + s) / 2.0 - TRUTH["fcn1"] * (1.0 - s) / 2.0
    slope = TRUTH["fvp1"] if v > 0.0 else TRUTH["fvn1"]
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
    """Slopes and levels by direction with the smooth sign of the truth."""
    own = leaderboard.reference_law()
    terms = tuple(replace(t, gamma=2000.0) if t.has_sign else t for t in own.terms)
    return replace(own, terms=terms)


def model_of(law, **values):
    return replace(law.model(TRUTH | values), drive_gain=GAIN)


def test_the_truth_scores_nothing_from_the_state_of_the_first_samples(simulated, law):
    whole = Stretch(0, 1500)
    assert model_of(law).score(simulated, whole) < 0.02  # mm, of 100 mm
    begin = model_of(law).loop(simulated, whole).begin
    assert begin[0][0] == pytest.approx(0.05, abs=1e-6)
    assert begin[1][0] == pytest.approx(0.02, abs=1e-4)
    assert model_of(law, fcp1=18.5).score(simulated, whole) > 0.5


def test_the_score_leaves_the_given_samples_out_and_counts_millimetres(simulated, law):
    whole, model = Stretch(0, 1500), model_of(law, fcp1=19.0)
    errors = model.errors(simulated, whole)
    motion = model.loop(simulated, whole)
    assert GIVEN == 20
    assert model.score(simulated, whole) == rms(errors[20:]) != rms(errors)
    later = simulated.q.copy()
    later[20:] += 1e-3
    moved = replace(simulated, q=later)
    np.testing.assert_allclose(model.errors(moved, whole)[20:], errors[20:] - 1.0, atol=1e-9)
    assert model.loop(moved, whole).begin == motion.begin


def test_a_later_position_never_reaches_the_simulation(simulated, law):
    """What is simulated depends on the input and on 20 positions alone."""
    model, whole = model_of(law), Stretch(0, 1500)
    blind = simulated.q.copy()
    blind[GIVEN:] = 0.0
    hidden = replace(simulated, q=blind)
    ours = model.errors(simulated, whole) + 1e3 * simulated.q[:, 0]
    theirs = model.errors(hidden, whole) + 1e3 * blind[:, 0]
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_derivatives_contain_the_initial_state(simulated, law):
    whole, model = Stretch(0, 1500), model_of(law)
    _, columns = model.linearised(simulated, whole)
    for k, name in enumerate(model.names):
        step = 1e-4 * TRUTH[name]
        ahead, behind = (
            model_of(law, **{name: TRUTH[name] + sign * step}).errors(simulated, whole)
            for sign in (1.0, -1.0)
        )
        slope = (ahead - behind) / (2.0 * step)
        assert np.abs(columns[:, k] - slope).max() < 1e-3 * np.abs(slope).max()


def test_a_fit_finds_the_truth_within_its_intervals(simulated, law):
    rng = np.random.default_rng(3)
    noisy = replace(simulated, q=simulated.q + 1e-6 * rng.normal(size=simulated.q.shape))
    start = replace(law.model(), drive_gain=GAIN)
    parts = [Stretch(k, k + 150) for k in range(0, 1500, 150)]
    found = fit_open_loop(start, noisy, parts)
    for name, truth in TRUTH.items():
        width = found.high[name] - found.low[name]
        assert 0.0 < width < 0.5 * truth
        assert abs(found.model.values[name] - truth) < width


def test_the_choice_opens_no_file(simulated, law, monkeypatch):
    opened = []
    for name in ("load_emps", "load_emps_pulses"):
        monkeypatch.setattr(leaderboard, name, lambda *given: opened.append(given))
    monkeypatch.setattr(leaderboard, "PERIOD", 500)
    monkeypatch.setattr(leaderboard, "reference_law", lambda: law)
    begin = TRUTH | {"fcp1": 18.5, "m1": 96.0}
    monkeypatch.setattr(leaderboard, "least_squares_start", lambda *given: begin)
    chosen, trials = leaderboard.choose(simulated, [law], (1, 2), further=False)
    assert not opened
    assert len(trials) == 3
    assert [len(trial.periods) for trial in trials] == [3, 3, 3]
    assert chosen.held_out == min(trial.held_out for trial in trials) < 0.05


def test_periods_and_stretches_cover_the_record_once():
    record = type("Record", (), {"q": np.zeros((24841, 1))})()
    periods = leaderboard.periods_of(record)
    assert [tuple(p) for p in periods] == [
        (0, 6240), (6240, 12480), (12480, 18720), (18720, 24841),
    ]  # fmt: skip
    for length in (1, 2, 4):
        parts = leaderboard.stretches_of(periods, length)
        assert len(parts) == 4 * length
        assert np.concatenate([np.arange(*p) for p in parts]).tolist() == list(range(24841))
    assert leaderboard.stretches_of([periods[0], periods[1], periods[3]], 0) == [
        Stretch(0, 12480), Stretch(18720, 24841),
    ]  # fmt: skip
