"""Which series of columns is which channel, and which robot joint each column belongs to."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.init.assumption import DraftError, Sureness
from pivident.init.log_files import LogFile, Run
from pivident.logs.bags.bag_table import OwnClock
from pivident.logs.recognition.column_series import JOINT, Series
from pivident.robot.naming import nearest

#: Share of samples with one and the same value from which on a torque is no signal.
MOSTLY_ONE_VALUE = 0.7

#: Motion that is none, as share of the largest motion of a joint in the log.
STILL = 1e-3


@dataclass(frozen=True, eq=False)
class ChannelColumns:
    """One channel as the log has it."""

    name: str  # ``q``, ``tau`` …
    file: int  # number of its file in the run
    columns: Mapping[str, str]  # column of each joint of the robot that it has, by the joint's name
    unit: str | None  # unit written in the names, or None
    is_current: bool  # whether the name is that of a current
    others: tuple[str, ...] = ()  # patterns of further series that could have been meant

    def values(self, run: Run, joints: Sequence[str]) -> np.ndarray:
        """Numbers of some joints as logged, shape (samples, joints)."""
        table = run.files[self.file].columns
        return np.column_stack([table[self.columns[joint]] for joint in joints])

    def own_clock(self, run: Run) -> OwnClock | None:
        """The clock of a channel that was logged beside the positions, by a clock of its own."""
        clocks = run.files[self.file].own_clocks
        return next((clocks[c] for c in self.columns.values() if c in clocks), None)


@dataclass(frozen=True, eq=False)
class JointMap:
    """Which columns belong to which joint."""

    channels: dict[str, ChannelColumns]  # with a column for some or all joints of ``q``
    sure: Sureness  # how sure the map from columns to joints is
    seen: str  # what it follows from


def joint_map(run: Run, joint_names: Sequence[str]) -> JointMap:
    """Choose the series of every channel and give their columns to the robot's joints."""
    listed = [(k, s) for k, file in enumerate(run.files) for s in file.series]
    positions = _ranked(listed, run, ("q",)) or _bare_positions(listed)
    torques = _ranked(listed, run, ("tau", "current"))
    for name, found in (("positions", positions), ("torques", torques)):
        if not found:
            raise DraftError(_not_found(name, run))
    keys = positions[0][1].columns
    joints, sure, seen = _joints_of(positions[0][1], joint_names)
    channels = {}
    for name, ranked in (
        ("q", positions),
        ("tau", torques),
        ("dq", _ranked(listed, run, ("dq",))),
        ("q_ref", _ranked(listed, run, ("q_ref",))),
        ("dq_ref", _ranked(listed, run, ("dq_ref",))),
    ):
        if ranked:
            channels[name] = _channel(name, ranked, joints, list(keys), joint_names)
    return JointMap(channels, sure, seen)


def is_informative(tau: np.ndarray) -> tuple[bool, str]:
    """Whether a torque column holds a signal, or why not; tau (samples,)."""
    finite = tau[np.isfinite(tau)]
    if not finite.size:
        return False, "no number in it"
    values, counts = np.unique(finite, return_counts=True)
    share = counts.max() / len(tau)
    if len(values) == 1:
        return False, f"always {values[0]:.4g}"
    if share > MOSTLY_ONE_VALUE:
        return False, f"exactly {values[counts.argmax()]:.4g} in {100 * share:.0f} % of the rows"
    return True, ""


def _ranked(
    listed: Sequence[tuple[int, Series]], run: Run, kinds: Sequence[str]
) -> list[tuple[int, Series]]:
    """Series of one quantity, the most likely one first."""
    own = [(k, s) for k, s in listed if s.channel in kinds]

    def merit(entry: tuple[int, Series]) -> tuple[float, ...]:
        file, series = entry
        table = run.files[file].columns
        alive = sum(bool(np.ptp(table[c]) > 0) for c in series.columns.values())
        kind = -kinds.index(str(series.channel))
        return (alive > 0, alive, series.reading.measured, series.named, kind)

    return sorted(own, key=merit, reverse=True)


def _bare_positions(listed: Sequence[tuple[int, Series]]) -> list[tuple[int, Series]]:
    """Columns named after axes alone: ``A1``, ``J2``, ``joint_3``."""
    return [
        (k, s)
        for k, s in listed
        if s.channel is None
        and not s.reading.foreign
        and JOINT in s.words
        and s.reading.measured >= 0
    ][:1]


def _joints_of(series: Series, joint_names: Sequence[str]) -> tuple[dict[str, str], Sureness, str]:
    """The robot's joint for each key of a series."""
    keys = list(series.columns)
    if series.named:
        return {k: k for k in keys}, "certain", "the columns carry names of the robot's joints"
    if keys == [""]:
        return {"": joint_names[0]}, "likely", "one position and no number: the first joint"
    numbers = sorted(keys, key=int)
    by_number = _by_number(joint_names)
    if len(numbers) == len(joint_names):
        named = next((own for _, own in by_number if len(own) == len(joint_names)), None)
        if named is not None and named != list(joint_names):
            pairs = dict(zip(numbers, named, strict=True))
            seen = f"{len(numbers)} numbered columns, as {named[0]} … {named[-1]}"
            return pairs, "likely", seen
        pairs = dict(zip(numbers, joint_names, strict=True))
        seen = f"{len(numbers)} numbered columns for {len(joint_names)} joints, from the base on"
        return pairs, "likely", seen
    for start, numbered in by_number:
        own = {str(int(k)): k for k in numbers}
        if len(numbered) == len(numbers) and int(numbers[0]) in (0, start):
            pairs = dict(zip(numbers, numbered, strict=True))
            seen = f"{len(numbers)} numbered columns, as {numbered[0]} … {numbered[-1]}"
            return pairs, "likely", seen
        if (
            start == 1
            and int(numbers[0]) >= 1
            and set(own) <= {str(k + 1) for k in range(len(numbered))}
        ):
            pairs = {own[k]: numbered[int(k) - 1] for k in own}
            return (
                pairs,
                "assumed",
                f"numbers {', '.join(numbers)} taken as those of the joints' names",
            )
    if len(numbers) < len(joint_names):
        pairs = dict(zip(numbers, joint_names, strict=False))
        seen = (
            f"{len(numbers)} numbered columns for {len(joint_names)} joints: taken for the first "
            "ones from the base on"
        )
        return pairs, "assumed", seen
    pairs = dict(zip(numbers, joint_names, strict=False))
    seen = (
        f"{len(numbers)} numbered columns for {len(joint_names)} joints: the first "
        f"{len(joint_names)} are taken"
    )
    return pairs, "assumed", seen


def _by_number(joint_names: Sequence[str]) -> list[tuple[int, list[str]]]:
    """Families of joints that differ in one number, with the first number; the largest first."""
    families: dict[str, list[tuple[int, str]]] = {}
    for name in joint_names:
        for found in re.finditer(r"\d+", name):
            family = f"{name[: found.start()]}#{name[found.end() :]}"
            families.setdefault(family, []).append((int(found[0]), name))
    ranked = sorted(families.values(), key=len, reverse=True)
    return [(min(own)[0], [name for _, name in sorted(own)]) for own in ranked if len(own) > 1]


def _channel(
    name: str,
    ranked: Sequence[tuple[int, Series]],
    joints: Mapping[str, str],
    keys: Sequence[str],
    joint_names: Sequence[str],
) -> ChannelColumns:
    """The best series of a channel by joint; in its own order if it counts from another number."""
    file, series = ranked[0]
    own = list(series.columns)
    if series.named or set(own) <= set(joints):
        columns = {joints.get(k, k): series.columns[k] for k in own if series.named or k in joints}
    elif len(own) == len(keys):
        order = sorted(own, key=lambda k: int(k or 0))
        taken = sorted(keys, key=lambda k: int(k)) if all(k.isdecimal() for k in keys) else keys
        columns = {
            joints[p]: series.columns[k] for p, k in zip(taken, order, strict=True) if p in joints
        }
    else:
        columns = {}
    others = tuple(next(iter(s.columns.values())) for _, s in ranked[1:])
    columns = {joint: columns[joint] for joint in joint_names if joint in columns}
    return ChannelColumns(
        name, file, columns, series.reading.unit, series.channel == "current", others
    )


def _not_found(what: str, run: Run) -> str:
    """That no column seems to hold a channel, and what columns there are."""
    names = [name for file in run.files for name in file.columns]
    listed = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    near = nearest("position" if what == "positions" else "torque", names)
    hint = f"; {near}" if near.startswith("did you mean") else ""
    return (
        f"no column of {_listed(run.files)} seems to hold {what} of joints; there are {listed}"
        f"{hint}. Rename the columns (q_1, tau_1 …), or write the experiment file by hand"
    )


def _listed(files: Sequence[LogFile]) -> str:
    return ", ".join(file.shown for file in files)
