"""Whether the log shows a law that compensates gravity while the file states one that does not.

For each joint the torque is fitted twice by least squares: with what a law makes of error and
speed, an integrator and a constant included, and with the columns of gravity at the measured
position besides. A law that compensates gravity leaves a static torque that follows the posture,
and next to nothing once gravity is among the columns.
"""

from __future__ import annotations

import numpy as np

from pivident.data.logs.log import Log
from pivident.estimation.control_law.law_gravity import GravityColumns, gravity_columns
from pivident.experiment.check.gains_check import CONTROLLER
from pivident.experiment.check.remark import usable_rows
from pivident.experiment.schema import ControllerEntry
from pivident.foundation.text.finding import Finding, FindingKind
from pivident.foundation.text.repair import Edit, Repair
from pivident.judgement.audit.timing import Timing

GRAVITY_SIGN = FindingKind(CONTROLLER, "gravity", ("controller",))

#: Share of the torque's variance that a law without gravity stays below, and that one with gravity
#: explains.
INCOMPLETE, COMPLETE = 0.98, 0.999

#: Fewest samples that are judged.
MIN_ROWS = 500


def check_gravity(log: Log, timing: Timing, entry: ControllerEntry) -> list[Finding]:
    """Joints whose torque needs gravity in the law that the file states without it."""
    given = [log.channels.get(c) for c in ("q", "q_ref", "tau")]
    if log.robot is None or log.robot.constraints is not None:
        return []
    if entry.feed_forward != "none" or not timing.rate or not timing.regular:
        return []
    if any(x is None or x.shape[1] != log.robot.size for x in given):
        return []
    rows = usable_rows(*(x for x in given if x is not None))
    if len(rows) < MIN_ROWS:
        return []
    q, q_ref, tau = (x[rows] for x in given if x is not None)
    found = []
    for j, columns in enumerate(gravity_columns(log.robot)):
        if columns.parameters:
            shares = _explained(q, q_ref[:, j], tau[:, j], timing.rate, columns)
            if shares[0] < INCOMPLETE and shares[1] > COMPLETE:
                found.append((log.joint_names[j], *shares))
    if not found:
        return []
    name, without, with_gravity = found[0]
    text = (
        f"Error and speed explain {100 * without:.3g} % of the torque of {name}, with gravity "
        f"at the measured position {100 * with_gravity:.4g} %: the controller of "
        f"{', '.join(own[0] for own in found)} compensates gravity, which the file does not "
        "state."
    )
    step = (
        'Set feed_forward = "gravity_measured" ("gravity" at the reference) if the '
        'controller uses the masses of the description; with controller = "identify" law and '
        "gravity model are identified from the log."
    )
    edit = Edit(("controller", "feed_forward"), "gravity_measured")
    words = 'Declare that the controller compensates gravity: feed_forward = "gravity_measured".'
    return [GRAVITY_SIGN.finding("warning", text, name, step, repairs=[Repair((edit,), words)])]


def _explained(
    q: np.ndarray, q_ref: np.ndarray, tau: np.ndarray, rate: float, columns: GravityColumns
) -> tuple[float, float]:
    """Shares of the torque's variance that a law explains, without gravity and with it."""
    own = q[:, columns.joint]
    error = q_ref - own
    law = [error, np.gradient(own) * rate, np.gradient(q_ref) * rate, np.cumsum(error) / rate]
    law += [np.diff(error, prepend=error[:1]) * rate, np.ones_like(error)]
    plain = np.column_stack(law)
    return _share(plain, tau), _share(np.column_stack([plain, columns.at(q)]), tau)


def _share(phi: np.ndarray, tau: np.ndarray) -> float:
    """Share of the variance of τ that least squares on the columns explains."""
    scale = np.maximum(np.linalg.norm(phi, axis=0), 1e-300)
    gains = np.linalg.lstsq(phi / scale, tau, rcond=None)[0]
    return 1.0 - float(np.var(tau - phi / scale @ gains) / max(np.var(tau), 1e-300))
