"""The open-loop protocol of benchmarks/emps_leaderboard.py: score, initial state, choice."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks import emps_leaderboard as leaderboard
from benchmarks.emps_laws import TWO_SLOPES, Candidate, laws
from benchmarks.open_loop_model import GIVEN, Stretch, rms

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import ExperimentError

GAIN, RATE = 35.15, 1000.0
TRUTH = {"m1": 95.0, "fvp1": 150.0, "fvn1": 230.0, "fc1": 21.0, "off1": -3.0}


def drive_input(samples):
    """Steps of both signs that keep the carriage on the rail [V]."""
    t = np.arange(samples) / RATE
    return 3.0 * np.sin(2.0 * np.pi * 3.1 * t) + 1.5 * np.sign(np.sin(2.0 * np.pi * 1.1 * t))


def acceleration(v, force):
    """Two slopes, Coulomb friction and an offset: the law, written a second time."""
    slope = TRUTH["fvp1"] if v > 0.0 else TRUTH["fvn1"]
    dry = TRUTH["fc1"] * 2.0 / np.pi * math.atan(2000.0 * v) + TRUTH["off1"]
    return (force - slope * v - dry) / TRUTH["m1"]


def moved(q, v, force, h):
    """A step of Runge and Kutta, to fourth order."""
    first = acceleration(v, force)
    second = acceleration(v + 0.5 * h * first, force)
    third = acceleration(v + 0.5 * h * second, force)
    last = acceleration(v + h * third, force)
    q += h * v + h**2 * (first + second + third) / 6.0
    return q, v + h * (first + 2.0 * (second + third) + last) / 6.0


@pytest.fixture(scope="module")
def simulated():
    """A record of the true carriage by an independent integrator, the input held each sample.

    Ten steps a sample are exact to a tenth of a nanometre.
    """
    u, state, q = drive_input(1500), (0.05, 0.02), []
    for force in (GAIN * u).tolist():
        q.append(state[0])
        for _ in range(10):
            state = moved(*state, force, 0.1 / RATE)
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


def test_a_carriage_at_rest_keeps_the_speed_that_its_positions_leave_open(simulated, law):
    """Encoder noise of a carriage that sticks must not become a speed."""
    stuck = Candidate("sharp sign", TWO_SLOPES)
    rng = np.random.default_rng(1)
    noise = 1e-6 * rng.normal(size=simulated.q.shape)
    still = replace(simulated, q=noise, tau=0.01 * simulated.tau)
    model = model_of(stuck)
    ((_, speed),) = model.starts(model.loop(still), still, [Stretch(0, 100)])
    assert abs(speed[0]) < 1e-3


def test_a_fit_over_the_record_finds_the_truth_and_its_constants(simulated, law, monkeypatch):
    monkeypatch.setattr(Candidate, "model", lambda own, values=None, make=Candidate.model:
                        replace(make(own, values), drive_gain=GAIN))  # fmt: skip
    rng = np.random.default_rng(3)
    noisy = replace(simulated, q=simulated.q + 1e-6 * rng.normal(size=simulated.q.shape))
    free = replace(law, constants=("gamma",))
    found = free.fitted(noisy)
    assert found.simulation.horizon == pytest.approx(1.5)
    model = free.model_of(found)
    for name, truth in TRUTH.items():
        assert model.values[name] == pytest.approx(truth, rel=0.01, abs=0.02)
    assert model.values["gamma"] == pytest.approx(2000.0, rel=0.1)
    assert model.score(noisy, Stretch(0, 1500)) < 0.02
    assert 0.0 < leaderboard.expected_error(free, found, noisy) < 0.1


@pytest.mark.parametrize("candidate", laws(), ids=lambda own: own.title)
def test_half_the_step_moves_no_law_by_two_micrometres(simulated, candidate):
    """Bristles of 5 µm and a sign of 25 µm/s pass within a sampling period, which covers 0.1 mm."""
    model = model_of(candidate, fv1=190.0, fs1=3.0, fvx1=15.0, fma1=7.0, fmb1=7.0, fmc1=7.0)
    whole = Stretch(0, 1500)
    change = model.errors(simulated, whole, finer=2) - model.errors(simulated, whole)
    assert np.abs(change).max() < 2e-3


def test_each_half_is_simulated_with_the_estimate_of_the_other(simulated, law, monkeypatch):
    fits, judged = [], []

    class Model:
        def errors(self, record, own):
            judged.append((fits[-1], own))
            return np.full(own.stop - own.start, 2.0)

    def fitted(candidate, record):
        fits.append(record)
        return None

    monkeypatch.setattr(Candidate, "fitted", fitted)
    monkeypatch.setattr(Candidate, "model_of", lambda *given: Model())
    monkeypatch.setattr(leaderboard, "refusal", lambda *given: "")
    trial = leaderboard.tried(law, simulated)
    first, second = judged
    assert (first[1], second[1]) == (Stretch(750, 1500), Stretch(0, 750))
    np.testing.assert_array_equal(first[0].q, simulated.q[:750])
    np.testing.assert_array_equal(second[0].q, simulated.q[750:])
    assert fits[-1] is simulated  # what is against a law is asked of the whole record
    assert trial.held_out == pytest.approx(2.0)
    assert trial.samples == 1500 - 2 * GIVEN


def trial(squares, terms=TWO_SLOPES, refused=""):
    return leaderboard.Trial(Candidate("", terms), np.array(squares, float), 100, refused)


def test_the_simplest_within_a_standard_error_is_chosen():
    best = trial([1.0, 1.0, 1.0, 1.0])
    close, far = trial([2.0, 0.5, 1.5, 0.8], TWO_SLOPES[:2]), trial([2.0] * 4, TWO_SLOPES[:2])
    assert leaderboard.simplest([best, close]) is close
    assert leaderboard.simplest([best, far]) is best
    better = trial([0.1] * 4, refused="not determined")
    assert leaderboard.simplest([better, best]) is best


def found_with(**own):
    """What a fit says of the constants and bounds of a law."""
    parts = {"at_bound": (), "held": (), "loop_parameters": ()} | own
    return SimpleNamespace(simulation=SimpleNamespace(**parts), names=("m1r", "fc1"))


def test_laws_are_refused_for_signs_and_for_constants_without_bound(simulated, law, monkeypatch):
    monkeypatch.setattr(leaderboard, "SAME", np.inf)  # beside the truth there are no errors
    monkeypatch.setattr(Candidate, "model_of", lambda own, found: model_of(own))
    assert leaderboard.refusal(law, found_with(), simulated) == ""
    assert "fc1" in leaderboard.refusal(law, found_with(at_bound=("fc1",)), simulated)
    assert "range: gamma1" in leaderboard.refusal(law, found_with(at_bound=("gamma1",)), simulated)
    assert "fs1" in leaderboard.refusal(law, found_with(held=("fs1",)), simulated)

    def of(name, value, std):
        own = SimpleNamespace(name=name, value=value, std=std)
        return leaderboard.refusal(law, found_with(loop_parameters=(own,)), simulated)

    assert "gamma1" in of("gamma1", 2000.0, 2000.0)
    assert of("gamma1", 2000.0, 500.0) == ""
    assert "delay" in of("delay", 1e-3, 6e-4)
    assert of("delay", 1e-3, 2e-4) == ""


def test_a_law_that_cannot_be_fitted_is_refused_with_the_reason(simulated, law, monkeypatch):
    def fitted(candidate, record):
        raise ExperimentError("no such friction")

    monkeypatch.setattr(Candidate, "fitted", fitted)
    trial = leaderboard.tried(law, simulated)
    assert "no such friction" in trial.refused and not np.isfinite(trial.held_out)


def test_the_choice_opens_no_file(simulated, law, monkeypatch):
    opened = []
    for name in ("load_emps", "load_emps_pulses"):
        monkeypatch.setattr(leaderboard, name, lambda *given: opened.append(given))
    monkeypatch.setattr(leaderboard, "refusal", lambda *given: "")
    monkeypatch.setattr(Candidate, "model", lambda own, values=None, make=Candidate.model:
                        replace(make(own, values), drive_gain=GAIN))  # fmt: skip
    chosen, trials = leaderboard.choose(simulated, [law], further=False)
    assert not opened
    assert trials == [chosen]
    assert chosen.held_out < 0.5  # of 100 mm, from three quarters of a second
