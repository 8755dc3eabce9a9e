"""Log files as the vendors' loggers write them, and the files that a user has beside them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .models import urdf
from .simulator import Trace
from .truth import Machine

#: Rate of the controllers [Hz], for even and odd seeds.
CONTROL = {"cobot6": (1000.0, 500.0), "link7": (1000.0, 1000.0), "scara": (1000.0, 1000.0)}

#: Share of the samples that the loggers with a clock of their own lose.
LOST = 0.003

Table = tuple[list[str], list[np.ndarray], list[str]]


def control_rate(made: Machine) -> float:
    """Rate of the hidden loop [Hz]."""
    return CONTROL[made.arm.name][made.seed % 2]


def write_log(path: Path, made: Machine, trace: Trace, references: str = "speed") -> None:
    """Write one run as the vendor's logger does.

    Args:
        path: the CSV file.
        made: the machine.
        trace: what happened.
        references: ``"speed"``, ``"position"`` or ``"both"``: what of the reference the cobot and
            the arm with torque sensors log; the SCARA logs positions.
    """
    rng = np.random.default_rng([made.seed, 4, *trace.motion.name.encode()])
    rows = logged_ticks(made, len(trace.q), rng)
    noise = np.array(made.arm.torque_noise) * rng.standard_normal((len(rows), made.arm.size))
    _TABLES[made.arm.name](path, made, trace, rows, noise, references)


def logged_ticks(made: Machine, ticks: int, rng: np.random.Generator) -> np.ndarray:
    """Indices of the controller's ticks that reach the log.

    The cobot's client is served every 10 or 12 ms, that of the arm with torque sensors every 4 to
    6 ms, and some samples get lost; the servo trace of the SCARA has every tick (odd seeds) or
    every fourth one.
    """
    rate = control_rate(made)
    if made.arm.name == "scara":
        return np.arange(0, ticks, 1 if made.seed % 2 else 4)
    if made.arm.name == "cobot6":
        steps = rng.choice([10, 12, 12, 10, 14], ticks, p=[0.48, 0.25, 0.15, 0.1, 0.02])
    else:
        steps = rng.choice([4, 5, 6], ticks, p=[0.25, 0.5, 0.25])
    at = np.concatenate([[0], np.cumsum(steps * rate / 1000.0)])
    at = at[at < ticks].astype(int)
    return at[rng.random(len(at)) >= LOST]


def _measured_speed(trace: Trace, smoothing: float = 0.15) -> np.ndarray:
    """What drives show as the actual speed: low-passed differences of the encoder."""
    from scipy.signal import lfilter

    difference = np.diff(trace.q_measured, axis=0, prepend=trace.q_measured[:1])
    return lfilter([smoothing], [1.0, smoothing - 1.0], difference * trace.motion.rate, axis=0)


def _write_cobot(path, made, trace, rows, noise, references) -> None:
    """An RTDE recorder: blanks between columns, seconds since the controller was started."""
    time = 170_000.0 + rows / trace.motion.rate
    speed = _measured_speed(trace)
    target = trace.tau / made.gain
    actual = (trace.tau + made.offset) / made.gain
    signals = {"actual_q": trace.q_measured[rows], "actual_qd": speed[rows]}
    if references in ("speed", "both"):
        signals["target_qd"] = trace.motion.dq[rows]
    if references in ("position", "both"):
        signals["target_q"] = trace.motion.q[rows]
    signals["actual_current"] = actual[rows] + noise
    signals["target_current"] = target[rows]
    names = [f"{name}_{k}" for name in signals for k in range(made.arm.size)]
    table = np.column_stack([time, *signals.values()])
    _write(path, " ", ["timestamp", *names], table, lambda name: "%.8f")


def _write_link(path, made, trace, rows, noise, references) -> None:
    """A node that writes the robot's state: commas, brackets, seconds since its start."""
    time = 3.2 + rows / trace.motion.rate
    signals = {"q": trace.q_measured[rows], "dq": _measured_speed(trace)[rows]}
    if references in ("speed", "both"):
        signals["dq_d"] = trace.motion.dq[rows]
    if references in ("position", "both"):
        signals["q_d"] = trace.motion.q[rows]
    signals["tau_J"] = trace.tau_link[rows] + made.offset + noise
    names = [f"{name}[{k}]" for name in signals for k in range(made.arm.size)]
    table = np.column_stack([time, *signals.values()])
    _write(path, ",", ["time", *names], table, lambda name: "%.8f")


def _write_scara(path, made, trace, rows, noise, references) -> None:
    """A servo trace: semicolons, milliseconds, degrees and millimetres."""
    scale = np.array([1e3 if j.kind == "prismatic" else 180 / np.pi for j in made.arm.joints])
    units = ["mm" if j.kind == "prismatic" else "deg" for j in made.arm.joints]
    forces = ["N" if j.kind == "prismatic" else "Nm" for j in made.arm.joints]
    header, columns = ["Time [ms]"], [1e3 * rows / trace.motion.rate]
    tau = trace.tau[rows] + made.offset + noise
    for i, joint in enumerate(made.arm.joints):
        header += [
            f"{joint.name}.PosCmd [{units[i]}]",
            f"{joint.name}.PosFbk [{units[i]}]",
            f"{joint.name}.TrqFbk [{forces[i]}]",
        ]
        columns += [scale[i] * trace.motion.q[rows, i], scale[i] * trace.q_measured[rows, i]]
        columns += [tau[:, i]]
    _write(path, ";", header, np.column_stack(columns), lambda name: "%.7f")


_TABLES = {"cobot6": _write_cobot, "link7": _write_link, "scara": _write_scara}


def _write(
    path: Path, separator: str, header: list[str], table: np.ndarray, form: Callable[[str], str]
) -> None:
    formats = [form(name) for name in header]
    np.savetxt(path, table, formats, separator, header=separator.join(header), comments="")


def write_robot(folder: Path, made: Machine) -> None:
    """The user's URDF and data sheet."""
    text = urdf(made.arm, made.urdf_bodies)
    (folder / f"{made.arm.name}.urdf").write_text(text, encoding="utf-8")
    (folder / "data_sheet.json").write_text(json.dumps(data_sheet(made), indent=1))


def data_sheet(made: Machine) -> dict:
    """What a user knows of the drives and the log."""
    arm = made.arm
    sheet: dict = {"control_rate_hz": control_rate(made)}
    if arm.torque_constant:
        sheet["torque_constant_nm_per_a"] = list(arm.torque_constant)
        sheet["gear_ratio"] = list(arm.gear_ratio)
    if arm.bearing_share < 1.0:
        sheet["torque_sensors"] = "behind the gears"
    for s in arm.shafts:
        sheet["ball_screw"] = {
            "motor": arm.joints[s.motor].name,
            "turns_with": arm.joints[s.joint].name,
            "lead_m_per_rad": s.ratio,
        }
    return sheet
