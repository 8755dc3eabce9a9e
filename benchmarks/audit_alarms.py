"""How often audit and check raise an alarm on clean records, and which faults they find.

    python benchmarks/audit_alarms.py             records of our simulator, planted delays
    python benchmarks/audit_alarms.py arms 0 100  records of Pinocchio, irregular clocks, stops
    python benchmarks/audit_alarms.py power 0 20  faults planted in such records

Records of the first kind come from the simulator with the robot's description as the truth. Those
of the second kind (`tests.other_arms`) have rates of 50 to 250 Hz, 10 and 12 ms in turn, jitter,
single lost samples, stops, encoders of 14 bits and speeds as drives log them; what is audited is
the bare file, what is checked the experiment file that `pivident init` writes for it. An alarm is
an error or a warning that is not true of the record: that an irregular clock is irregular is true,
so is that a parameter is poorly excited if least squares misses it by a fifth of its value, or
would in another record of the same motion, and then so is a large condition.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.judgement.audit.logs import clean_log, delayed, serious, with_channels
from tests.other_arms import ArmLog, Setting, make_log

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.experiment.check.audit_file import audit_file
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.text.finding import Finding
from pivident.judgement.audit.audit import audit_log
from pivident.judgement.audit.excitation import WEAK
from pivident.robot.urdf import read_urdf

#: Robot, length [s] and number of records.
RECORDS = (("planar_2r", 5.0, 60), ("staubli_tx40", 4.0, 40), ("staubli_tx40", 2.0, 40))

#: Delays that are planted [s].
DELAYS = (0.0, 3e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2)

#: What is true of the clock of a record, by its kind.
TRUE = {
    "alternating": {"jitter"},
    "jitter": {"jitter"},
    "gaps": {"jitter", "gap"},
    "regular": set(),
}

#: What check may rightly say of a record: `init` cuts one with gaps to the longest stretch between
#: them, which can be too short.
CUT = {"gaps": {"too short", "folds"}, "alternating": set(), "jitter": set(), "regular": set()}


def alarms() -> None:
    """Count the records with an alarm."""
    for robot, seconds, number in RECORDS:
        kinds: Counter[str] = Counter()
        records = 0
        for seed in range(number):
            found = serious(audit_log(clean_log(robot, 100 + seed, seconds)))
            kinds.update(f"{severity} {kind}" for severity, kind, _ in found)
            records += bool(found)
        print(f"{robot}, {seconds:g} s: {records} of {number} records with an alarm {dict(kinds)}")


def delays(seeds: int = 8) -> None:
    """Median error and deviation of planted delays, and how often each was found."""
    for robot, seconds, _ in RECORDS:
        for late in DELAYS:
            errors, deviations, severities = [], [], Counter()
            for seed in range(seeds):
                log = clean_log(robot, 100 + seed, seconds)
                rate = 1.0 / float(np.median(np.diff(log.clock)))
                tau = np.column_stack([delayed(x, late * rate) for x in log.channels["tau"].T])
                audit = audit_log(with_channels(log, tau=tau))
                mean, deviation = audit.delay.common
                errors.append(abs(mean - late))
                deviations.append(deviation)
                severities[next(f.severity for f in audit.of("delay"))] += 1
            print(
                f"{robot}, {seconds:g} s, {1e3 * late:g} ms: "
                f"error {1e3 * np.median(errors):.3f} ms, "
                f"deviation {1e3 * np.median(deviations):.3f} ms, {dict(severities)}"
            )


def setting(seed: int) -> Setting:
    """Clock, rate, length, stops, noise and speeds of a record."""
    rng = np.random.default_rng([seed, 7])
    clock = ("alternating", "jitter", "gaps", "regular")[seed % 4]
    rates = (1000 / 11, 2000 / 11) if clock == "alternating" else (50, 91, 100, 125, 200, 250)
    return Setting(
        clock=clock,
        rate=float(rng.choice(rates)),
        seconds=float(rng.choice([20, 30, 40])),
        stops=float(rng.choice([0.0, 0.5, 2.0])),
        torque_noise=float(rng.choice([0.002, 0.005, 0.02])),
        speed=str(rng.choice(["none", "true", "drive", "drive"])),  # type: ignore[arg-type]
        fastest=float(rng.choice([0.5, 0.8])),
    )


def is_missed(log: ArmLog, path: Path, name: str) -> bool:
    """Whether error or standard error of a base parameter is more than `WEAK` of its value."""
    experiment = load_experiment(path)
    robot = experiment.robot
    base = base_parameters(robot)
    standard = nominal_values(robot, base.standard)
    for k, parameter in enumerate(base.standard):
        if parameter.stem == "ia":
            joint = log.arm.joint_names.index(robot.joint_names[parameter.joint])
            standard[k] = log.arm.rotor_inertia[joint]
    k = base.names.index(name)
    truth = base.values(standard)[k]
    found = identify(Problem(robot, experiment.recordings()), LeastSquares())
    return bool(max(abs(found.theta[k] - truth), found.std[k]) > WEAK * abs(truth))


def findings_of(log: ArmLog, clock: str) -> tuple[list[Finding], list[Finding]]:
    """What audit and check have against a record and is not true of its clock."""
    with tempfile.TemporaryDirectory() as folder:
        table, robot = log.write(Path(folder))
        (audit,) = audit_file(table, read_urdf(robot))
        out = Path(folder) / "experiment.toml"
        out.write_text(draft_experiment([table], str(robot), out=out).text, encoding="utf-8")
        check = check_experiment(out)
        found = [
            [f for f in own if f.severity in ("warning", "error") and f.kind not in true]
            for own, true in ((audit.findings, TRUE[clock]), (check.remarks, CUT[clock]))
        ]
        weak = {f.subject for own in found for f in own if f.kind == "weak"}
        missed = {name for name in weak if is_missed(log, out, name)}
    audited, checked = (
        [f for f in own if f.subject not in missed and not (missed and f.kind == "rank")]
        for own in found
    )
    return audited, checked


def arms(first: int, last: int) -> None:
    """Count alarms on records of arms that another program made."""
    kinds: dict[str, Counter[str]] = {"audit": Counter(), "check": Counter()}
    records: Counter[str] = Counter()
    for seed in range(first, last):
        given = setting(seed)
        for name, found in zip(kinds, findings_of(make_log(seed, given), given.clock), strict=True):
            records[name] += bool(found)
            kinds[name].update(f"{f.severity} {f.kind}" for f in found)
            for finding in found:
                print(f"{seed} {given.clock} {given.rate:.4g} Hz, {name}: {finding}", flush=True)
    for name, own in kinds.items():
        print(f"{name}: {records[name]} of {last - first} records with an alarm {dict(own)}")


def late_torque(samples: float) -> Callable[[ArmLog], ArmLog]:
    """Torques that come so many samples late."""
    return lambda log: _with(log, tau=np.column_stack([delayed(x, samples) for x in log.tau.T]))


def slow_speed(seconds: float) -> Callable[[ArmLog], ArmLog]:
    """Logged speeds behind a low-pass of first order."""

    def change(log: ArmLog) -> ArmLog:
        speed, out = log.motion[1], np.zeros_like(log.tau)
        forget = np.exp(-np.diff(log.t) / seconds)
        for k in range(1, len(out)):
            out[k] = forget[k - 1] * out[k - 1] + (1.0 - forget[k - 1]) * speed[k]
        return _with(log, dq=out)

    return change


def lost(number: int) -> Callable[[ArmLog], ArmLog]:
    """Samples that are missing, and stamps of a log that does not know."""

    def change(log: ArmLog) -> ArmLog:
        moving = np.flatnonzero((np.abs(log.motion[1]) > 0.2 * log.arm.speed).any(axis=1))[50:-50]
        rows = np.random.default_rng(number).choice(moving, number, replace=False)
        kept = {n: np.delete(column, rows) for n, column in log.columns.items()}
        return replace(log, columns=kept, t=log.t[: len(log.t) - number])

    return change


def clipped(share: float) -> Callable[[ArmLog], ArmLog]:
    """A torque cut off at a share of its largest value."""

    def change(log: ArmLog) -> ArmLog:
        tau = log.tau.copy()
        limit = share * np.abs(tau[:, 1]).max()
        tau[:, 1] = np.clip(tau[:, 1], -limit, limit)
        return _with(log, tau=tau)

    return change


def scaled(channel: str, factor: float, joint: int | None = None) -> Callable[[ArmLog], ArmLog]:
    """A channel, or one joint of it, in another unit."""

    def change(log: ArmLog) -> ArmLog:
        values = np.array({"q": log.q, "tau": log.tau, "dq": log.motion[1]}[channel])
        values[:, slice(None) if joint is None else joint] *= factor
        return _with(log, **{channel: values})

    return change


#: Faults, and the kinds of findings of which one has to be there.
FAULTS: dict[str, tuple[Callable[[ArmLog], ArmLog], set[str]]] = {
    "torque 1 sample late": (late_torque(1.0), {"late", "timing"}),
    "torque 2 samples late": (late_torque(2.0), {"late"}),
    "torque 4 samples late": (late_torque(4.0), {"late"}),
    "speed behind 20 ms": (slow_speed(0.02), {"derivative"}),
    "speed behind 50 ms": (slow_speed(0.05), {"derivative"}),
    "3 samples lost, unstamped": (lost(3), {"lost"}),
    "torque of axis 2 clipped at 60 %": (clipped(0.6), {"clipped"}),
    "positions in degrees": (scaled("q", 180.0 / np.pi), {"angle unit", "reach"}),
    "torques of axis 2 times 1.5": (scaled("tau", 1.5, 1), {"gain"}),
    "torque of axis 3 reversed": (scaled("tau", -1.0, 2), {"sign", "gravity at rest", "gain"}),
    "speeds in degrees": (scaled("dq", 180.0 / np.pi), {"derivative"}),
}


def power(first: int, last: int) -> None:
    """In how many records each planted fault is found."""
    counts: dict[str, Counter[str]] = {name: Counter() for name in FAULTS}
    for seed in range(first, last):
        log = make_log(seed, setting(seed))
        for name, (change, kinds) in FAULTS.items():
            with tempfile.TemporaryDirectory() as folder:
                table, robot = change(log).write(Path(folder))
                (audit,) = audit_file(table, read_urdf(robot))
            found = {f.severity for f in audit.findings if f.kind in kinds} - {"ok"}
            counts[name][max(found, key=("note", "warning", "error").index, default="none")] += 1
        print(f"{seed}: " + ", ".join(f"{n} {dict(c)}" for n, c in counts.items()), flush=True)
    for name, count in counts.items():
        print(f"{name:<34} {dict(count)}")


def _with(log: ArmLog, **channels: np.ndarray) -> ArmLog:
    """The log with other samples of a channel in its columns."""
    columns = dict(log.columns)
    for channel, values in channels.items():
        for k, name in enumerate(log.arm.joint_names):
            columns[f"{channel}_{name}"] = values[:, k]
    return replace(log, columns=columns)


if __name__ == "__main__":
    what, *bounds = sys.argv[1:] or ["simulator"]
    if what == "simulator":
        alarms()
        delays()
    else:
        {"arms": arms, "power": power}[what](*map(int, bounds or ["0", "20"]))
