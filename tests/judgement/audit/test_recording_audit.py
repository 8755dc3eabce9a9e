"""What is wrong with a recording is known before its estimate is believed."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.judgement.audit.blocked_fit import BLOCKS
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.recording_audit import recording_faults
from pivident.judgement.audit.steps import hidden_jitter, unsteady_steps
from pivident.judgement.audit.timing import check_timing
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from pivident.robot.gallery import load_robot
from tests.judgement.audit.logs import clean_log, delayed, planar


def recording(seed: int = 5, **changes) -> Recording:
    log = planar(seed)
    channels = {"q": log.channels["q"], "tau": log.channels["tau"]} | changes
    return Recording.from_arrays(
        rate=1000.0, joint_names=log.joint_names, name=f"run {seed}", **channels
    )


def faults(*recordings: Recording) -> list[tuple[str, str, str]]:
    found = recording_faults(load_robot("planar_2r"), recordings)
    return [(f.severity, f.kind, f.subject) for f in found]


def test_nothing_is_said_of_clean_recordings():
    assert faults(recording(5), recording(6)) == []


def test_lost_samples():
    made = recording()
    rows = np.delete(np.arange(made.samples), [700, 1500, 2200])
    lost = replace(made, q=made.q[rows], tau=made.tau[rows])
    assert faults(lost) == [("error", "lost", "q")]


def test_several_recordings_share_a_fault():
    late = [recording(s) for s in (5, 6)]
    late = [replace(r, tau=np.column_stack([delayed(x, 2) for x in r.tau.T])) for r in late]
    (found,) = recording_faults(load_robot("planar_2r"), [recording(7), *late])
    assert found.kind == "late" and found.message.startswith("run 5, run 6: The torque is ")
    assert found.quantity.value == pytest.approx(2.0, abs=0.05)


def test_declared_delays_are_none():
    tau = np.column_stack([delayed(x, 2) for x in planar().channels["tau"].T])
    assert faults(recording(tau=tau, delay=2e-3)) == []
    early = np.column_stack([delayed(x, -2) for x in planar().channels["tau"].T])
    assert faults(recording(tau=early, drive_delay=2e-3)) == []
    assert faults(recording(tau=early)) == [("error", "early", "")]


def test_a_torque_of_another_scale_is_a_reservation():
    """What no residual shows: parameters of the last joint take the factor."""
    tau = planar().channels["tau"] * np.array([1.0, 2.0])
    (found,) = recording_faults(load_robot("planar_2r"), [recording(tau=tau)])
    assert (found.severity, found.kind, found.subject) == ("warning", "gain", "elbow")
    assert found.quantity.value == pytest.approx(2.0, rel=0.03)
    newtons = planar().channels["tau"] * np.array([1.0, 1000.0])
    assert faults(recording(tau=newtons)) == [("warning", "gain", "elbow")]


def test_masses_that_the_description_has_wrong_are_no_fault_of_the_log():
    """A torque of another shape: a payload far from the axis of the elbow's own link."""
    robot = load_robot("planar_2r")
    links = list(robot.links)
    links[1] = replace(links[1], inertia=links[1].inertia * np.array([1] * 6 + [0, 1, 1, 1.0]))
    other = replace(robot, links=tuple(links))
    assert not [f for f in recording_faults(other, [recording()]) if f.kind == "gain"]


def test_a_torque_that_is_cut_off_is_a_reservation():
    made = recording()
    limit = 0.7 * np.abs(made.tau[:, 1]).max()
    tau = np.column_stack([made.tau[:, 0], np.clip(made.tau[:, 1], -limit, limit)])
    cut = Recording.from_arrays(
        made.q, tau, 1000.0, joint_names=made.joint_names, saturation="allow"
    )
    assert ("warning", "clipped", "tau of elbow") in faults(cut)
    problem = Problem(load_robot("planar_2r"), (cut,))
    found = verdict(diagnose(problem, {"ls": identify(problem, "ls")}, folds=3))
    (said,) = [s for s in found.reservations if "tau of elbow is cut off" in s.message]
    assert "Cut these parts" in said.next_step  # to allow it again is no repair to be tried


def test_a_torque_with_the_wrong_sign():
    tau = planar().channels["tau"] * np.array([1.0, -1.0])
    assert ("error", "sign", "elbow") in faults(recording(tau=tau))


def test_spikes_of_positions():
    q = planar().channels["q"].copy()
    q[2000, 1] += 0.01
    assert ("warning", "spike", "q of elbow") in faults(recording(q=q))


def test_a_recording_too_short_to_compare_is_not_judged():
    assert faults(recording().part(1000, 1300)) == []


@pytest.mark.parametrize("deviation", [0.1, 0.25, 0.4])
@pytest.mark.parametrize("kind", ["normal", "uniform"])
def test_instants_that_tremble_are_no_lost_samples(deviation, kind):
    """Positions between the samples: q(t + δ) of a smooth motion, from its cubic spline."""
    rng = np.random.default_rng(3)
    q = clean_log("staubli_tx40", 101, 4.0).channels["q"]
    k = np.arange(len(q))
    apart = (
        deviation * rng.standard_normal(len(q))
        if kind == "normal"
        else deviation * np.sqrt(3.0) * rng.uniform(-1.0, 1.0, len(q))
    )
    moved = np.column_stack([delayed(x, -apart) for x in q.T])
    assert hidden_jitter(q) == 0.0
    assert len(unsteady_steps(moved)) == 0
    if deviation > 0.1:
        assert hidden_jitter(moved) == pytest.approx(deviation, rel=0.1)
    rows = np.delete(k, [6000, 6001])
    assert unsteady_steps(q[rows]).tolist() == [[5999.0, 2.0]]


def test_repeated_samples_are_no_trembling():
    q = clean_log("staubli_tx40", 101, 4.0).channels["q"]
    k = np.arange(len(q))
    k[np.random.default_rng(4).random(len(q)) < 0.3] -= 1
    assert hidden_jitter(q[np.maximum(k, 0)]) == 0.0


def test_trembling_is_said_with_its_size():
    q = planar().channels["q"]
    apart = 0.3 * np.random.default_rng(5).standard_normal(len(q))
    moved = np.column_stack([delayed(x, -apart) for x in q.T])
    (found,) = recording_faults(load_robot("planar_2r"), [recording(q=moved)])
    assert (found.severity, found.kind) == ("warning", "hidden jitter")
    assert found.quantity.value == pytest.approx(0.3, rel=0.15)


def test_a_computed_torque_is_not_held_against_its_motion():
    tau = planar().channels["tau"] * np.array([1.0, -1.0])
    made = replace(recording(tau=tau), torque_source="law")
    assert faults(made) == []
    q = made.q.copy()
    q[900, 1] += 0.3
    assert [kind for _, kind, _ in faults(replace(made, q=q))] == ["spike"]


def test_a_frozen_torque_is_a_reservation():
    tau = planar().channels["tau"].copy()
    tau[300:420, 1] = tau[300, 1]
    assert ("error", "frozen", "tau of elbow") in faults(recording(tau=tau))


def at_rest_behind(q: np.ndarray, samples: int, seed: int) -> np.ndarray:
    """Positions that come to rest within a second of 1 kHz, read by an encoder of 16 bits."""
    slower = np.clip(np.arange(1000) / 1000.0, 0.0, 1.0)
    path = len(q) - 1001 + np.cumsum(1.0 - slower**2 * (3.0 - 2.0 * slower))
    stop = np.column_stack([np.interp(path, np.arange(len(q)), x) for x in q.T])
    whole = np.vstack([q[:-1000], stop, np.repeat(stop[-1:], samples, axis=0)])
    count = 2.0 * np.pi / 2**16
    flicker = 0.1 * count * np.random.default_rng(seed).standard_normal(whole.shape)
    return count * np.round((whole + flicker) / count)


@pytest.mark.parametrize("seed", range(3))
def test_a_long_rest_behind_a_short_motion_hides_and_invents_no_samples(seed):
    # at rest an encoder is steadier than in motion, and says nothing of what is usual there
    q = at_rest_behind(planar(seed).channels["q"][:3000], 27_000, seed)
    assert len(unsteady_steps(q)) == 0
    k = 100 + int(np.argmax(np.abs(q[101:1800] - q[99:1798]).min(axis=1)))  # both joints are fast
    lost = np.delete(q, [k + 1, k + 2, k + 3], axis=0)
    assert unsteady_steps(lost).tolist() == [[float(k), 3.0]]


def test_a_delay_is_judged_by_stretches_of_motion_not_of_rest():
    log = planar()
    rest = 9 * log.samples
    channels = {
        kind: np.vstack([x, np.repeat(x[-1:], rest, axis=0)]) for kind, x in log.channels.items()
    }
    log = replace(log, channels=channels, logged=dict(channels), clocks={}, rate=1000.0)
    model = build_inverse_model(log, check_timing(log))
    counts = np.bincount(model.block[model.moving.any(axis=1)])
    assert len(counts) == BLOCKS and counts.max() < 1.2 * counts.min()


def test_what_fills_left_out_samples_is_no_frozen_torque():
    """A constant keeps the filters from ringing there; nobody has measured it."""
    tau, valid = planar().channels["tau"].copy(), np.ones((len(planar().channels["tau"]), 2), bool)
    tau[:1000, 1] = tau[1000, 1]
    assert ("error", "frozen", "tau of elbow") in faults(recording(tau=tau))
    valid[:1000, 1] = False
    assert faults(replace(recording(tau=tau), valid=valid)) == []


@pytest.mark.parametrize(("samples", "side"), [(2, "later"), (-2, "earlier")])
def test_a_delay_says_its_side_and_its_repair_declares_it(samples, side):
    tau = np.column_stack([delayed(x, samples) for x in planar().channels["tau"].T])
    (fault,) = recording_faults(load_robot("planar_2r"), [recording(tau=tau)])
    assert f"samples) {side} than the positions" in fault.message
    edit = fault.repairs[0].edits[0]
    assert edit.place == ("recording", "delay")
    assert edit.value == pytest.approx(samples * 1e-3, abs=5e-5)
    more = [repair.edits[0].place[-1] for repair in fault.repairs[1:]]
    assert more == ([] if samples > 0 else ["drive_delay"])
