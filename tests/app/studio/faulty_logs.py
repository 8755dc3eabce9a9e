"""Logs and experiment files of the planar arm with one fault each."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from tests.planar_log import EXPERIMENT, HEADER, planar_log

#: Columns of the log.
TIME, Q, R, TAU = 0, slice(1, 3), slice(3, 5), slice(5, 7)


@dataclass(frozen=True)
class Fault:
    """What is done to a good log or its file, and the remark that follows.

    Attributes:
        kind: topic and kind of the remark.
        rows: makes the wrong log of the right one.
        old: part of the file …
        new: … and what stands there instead.
        header: of the log.
    """

    kind: tuple[str, str]
    rows: Callable[[np.ndarray], np.ndarray] = lambda rows: rows
    old: str = ""
    new: str = ""
    header: str = HEADER

    def write(self, folder: Path) -> Path:
        """Write log and experiment file; returns the latter."""
        rows = self.rows(planar_log().copy())
        np.savetxt(
            folder / "log.csv", rows, fmt="%.9g", delimiter=",", header=self.header, comments=""
        )
        assert self.old in EXPERIMENT
        path = folder / "experiment.toml"
        text = EXPERIMENT.replace(self.old, self.new, 1)
        if "[[recording]]" in text:
            text = text.replace("\n[recording]\n", "\n[[recording]]\n")
        path.write_text(text, encoding="utf-8")
        return path


def changed(columns, change):
    """A log with some columns changed."""

    def made(rows):
        rows[:, columns] = change(rows[:, columns])
        return rows

    return made


def late(samples):
    """Torques that come so many samples later."""

    def moved(tau):
        k = np.arange(len(tau))
        return CubicSpline(k, tau)(np.clip(k - samples, 0, len(tau) - 1))

    return changed(TAU, moved)


def jittery(rows):
    rng = np.random.default_rng(3)
    rows[:, TIME] += 4e-4 * rng.uniform(-1.0, 1.0, len(rows))
    return rows


def with_speeds(rows):
    """Two more columns: twice the derivative of the reference [deg/s]."""
    return np.column_stack([rows, 2.0 * np.gradient(rows[:, R], rows[:, TIME], axis=0)])


HEAD = "[recording]\n"
ROBOT = 'robot = "planar_2r"\n\n[recording]\n'
GEARED = 'robot = {model = "planar_2r", reduction = [50.0, 50.0]}\n'
NAMED = EXPERIMENT[EXPERIMENT.index("columns") : EXPERIMENT.index(', q_ref = "deg"')]
NAMED_OTHERWISE = NAMED.replace('"q1", "q2"', '"deg1", "deg2"').replace('"deg"', '"rad"')
SPEEDS = 'tau = ["tau1", "tau2"], dq_ref = ["v1", "v2"]}\nunits = {dq_ref = "deg/s", '

FAULTS = {
    "late torque": Fault(("delay", "late"), late(10)),
    "early torque": Fault(("delay", "early"), late(-10)),
    "delay in milliseconds": Fault(("timing", "delay"), late(10), HEAD, HEAD + "delay = 10\n"),
    "irregular stamps": Fault(("timing", "jitter"), jittery),
    "gap": Fault(("timing", "gap"), lambda rows: np.delete(rows, np.s_[3000:3500], axis=0)),
    "other rate": Fault(("timing", "rate change"), lambda rows: np.r_[rows[:5000], rows[5000::2]]),
    "milliseconds": Fault(("timing", "rate"), changed(TIME, lambda t: 1e3 * t), "units = {",
                          'units = {t = "s", '),
    "wrong rate": Fault(("timing", "drift"), old=HEAD, new=HEAD + "rate = 900.0\n"),
    "held torque": Fault(("timing", "control rate"),
                         changed(TAU, lambda tau: np.repeat(tau[::4], 4, axis=0))),
    "loop rate": Fault(("timing", "control rate"), old=HEAD, new=HEAD + "control_rate = 250.0\n"),
    "reversed torque": Fault(("power", "sign"), changed(6, np.negative)),
    "reversed torques": Fault(("power", "sign"), changed(TAU, np.negative)),
    "radians": Fault(("scale", "angle unit"), changed(slice(1, 5), np.deg2rad)),
    "degrees": Fault(("scale", "reach"), old='{q = "deg", q_ref = "deg"',
                     new='{q = "rad", q_ref = "deg"'),
    "swapped torques": Fault(("order", "order"), lambda rows: rows[:, [0, 1, 2, 3, 4, 6, 5]]),
    "numbers": Fault(("columns", "joint order"), old='["tau1", "tau2"]', new='["tau2", "tau1"]'),
    "named unit": Fault(("columns", "unit"), old=NAMED, new=NAMED_OTHERWISE,
                        header=HEADER.replace("q1,q2", "deg1,deg2")),
    "no torque": Fault(("columns", "torque not named"), old=', tau = ["tau1", "tau2"]', new=""),
    "swapped references": Fault(("reference", "order"), old='["r1", "r2"]', new='["r2", "r1"]'),
    "reference in radians": Fault(("reference", "unit"), old='q_ref = "deg"', new='q_ref = "rad"'),
    "reversed reference": Fault(("reference", "unit"), changed(3, np.negative)),
    "gain of the loop": Fault(("controller", "gain"), old="[6000, 2500]", new="[600, 2500]"),
    "limit of the loop": Fault(("controller", "limit"), old="kd = ", new="limit = 20.0\nkd = "),
    "sense": Fault(("geometry", "sense"), changed([2, 4, 6], np.negative)),
    "gravity": Fault(("geometry", "gravity"), old='robot = "planar_2r"',
                     new='robot = {model = "planar_2r", gravity = "+z"}'),
    "speed": Fault(("speed", "derivative"), with_speeds, 'tau = ["tau1", "tau2"]}\nunits = {',
                   SPEEDS, header=HEADER + ",v1,v2"),
    "unknown key": Fault(("file", "unknown key"), old=HEAD, new=HEAD + "dely = 0.0\n"),
    "value": Fault(("file", "value"), old="[identify]",
                   new="[validation]\nfolds = 1\n[identify]"),
    "column": Fault(("recording", "refused"), old='"tau2"', new='"tau_2"'),
    "robot": Fault(("robot", "refused"), old="planar_2r", new="planer_2r"),
    "method": Fault(("file", "value"), old='["ls"]', new='["ls", "vi"]'),
    "averaged torque": Fault(("delay", "late"),
                             changed(TAU, lambda tau: np.roll(tau, 1, axis=0))),
    "amperes": Fault(("scale", "gain"), changed(TAU, lambda tau: tau / 12.5), 'tau = "N m"',
                     'tau = "A"'),
    "side of the positions": Fault(("scale", "side"), changed(TAU, lambda tau: tau / 50.0), ROBOT,
                                   f"{GEARED}\n[recording]\nside = 'motor'\n"),
    "side of the torques": Fault(("scale", "gain"), changed(TAU, lambda tau: tau / 50.0), ROBOT,
                                 f"{GEARED}\n[recording]\n"),
    "sensors": Fault(("scale", "torque side"), old=ROBOT,
                     new=ROBOT + 'torque_side = "link"\n'),
    "same run": Fault(("recordings", "same run"), old="[controller]", new=(
        '[[recording]]\nfiles = "log.csv"\npart = [1.0, 5.0]\n'
        'columns = {t = "time", q = ["q1", "q2"], tau = ["tau1", "tau2"], q_ref = ["r1", "r2"]}\n'
        'units = {q = "deg", q_ref = "deg"}\n[controller]')),
}  # fmt: skip
