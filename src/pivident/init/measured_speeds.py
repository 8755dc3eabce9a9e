"""Logged speeds with noise of their own: columns for instruments of kind ``sensor``.

Most speeds of a log are differences of its positions. They add nothing, and are left out. Those of
another sensor do, and those that a drive makes of fine counts between the samples of the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pivident.init.kept_joints import KeptJoints
from pivident.instruments.second_sensor import SAME_SENSOR, explained_noise
from pivident.logs.clocks.timestamps import resample_smooth
from pivident.logs.recognition.joint_columns import JointMap
from pivident.logs.recognition.log_file import Run
from pivident.logs.recognition.position_units import following_unit
from pivident.logs.units import SPEED
from pivident.text.numbers import percent

#: Samples that are compared: enough to tell 0.05 from 0.1.
COMPARED = 5000


def measured_speeds(
    run: Run,
    joints: JointMap,
    kept: KeptJoints,
    q: np.ndarray,
    seconds: np.ndarray,
    rows: np.ndarray,
    units: Sequence[str],
) -> dict[str, tuple[Any, str]]:
    """Unit of ``dq`` and what was seen, where its noise is not that of the positions; else nothing.

    ``q``: positions of the joints that are kept, shape (samples, joints) [rad or m];
    ``seconds``: their stamps; ``rows``: samples that are used; ``units``: of each joint's
    positions in the log.
    """
    channel = joints.channels.get("dq")
    if channel is None or not set(kept.names) <= set(channel.columns) or channel.own_clock(run):
        return {}
    values = channel.values(run, kept.names)
    one_clock = len(values) == len(q) and (np.diff(seconds[rows]) > 0.0).all()
    if not one_clock or not np.isfinite(values).all():  # a channel with gaps would be refused
        return {}
    first = max(0, (int(rows.sum()) - COMPARED) // 2)
    t, x, y = (a[rows][first : first + COMPARED] for a in (seconds, q, values))
    found = [_unit(q, dq, t, own) for q, dq, own in zip(x.T, y.T, units, strict=True)]
    if None in found:
        return {}
    even = np.linspace(t[0], t[-1], len(t))
    x, y = (resample_smooth(t, values, even) for values in (x, y))
    share = float(explained_noise(x, y, (len(t) - 1) / (t[-1] - t[0])).max())
    if share > SAME_SENSOR:
        return {}
    seen = (
        "its noise is not that of the positions, which explains at most "
        f"{percent(100 * max(share, 0.0))} of it: instruments may come from it"
    )
    return {"dq": (found[0] if len(set(found)) == 1 else found, seen)}


def _unit(q: np.ndarray, dq: np.ndarray, t: np.ndarray, unit: str) -> str | None:
    """Unit in which a logged speed follows the derivative of the position, or nothing."""
    tried = ("m/s", "mm/s") if unit in ("m", "mm") else ("rad/s", "deg/s", "rev/s", "rpm")
    match = following_unit(dq[:, None], np.gradient(q, t)[:, None], tried, SPEED)
    return None if match is None else match[0]
