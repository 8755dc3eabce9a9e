"""What positions alone cannot tell, and which methods make sense of them.

A torque computed from the control law, τ = C (q_ref - q), holds nothing that reference, position
and gains do not. Scaling the gains scales it, and with it inertia, friction and gravity alike: the
motion stays the same. The encoder noise is in it as it is in the regressor, so least squares is
biased by construction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pivident.recording.recording import Recording
from pivident.simulation.control_loop import Loop
from pivident.simulation.controllers import PythonController
from pivident.text.finding import Finding
from pivident.text.lists import listed

#: Topic of the findings.
TOPIC = "without torque"

#: What every result of such a log says.
_SCALE = Finding(
    "warning",
    TOPIC,
    "scale",
    "No torque was logged. Positions cannot tell the common scale of inertias, friction, gravity "
    "and gains: it is that of the declared gains. If these are all 10 % too large, so are all "
    "parameters, and no test of this record shows it; their intervals do not contain it.",
    next_step="Compare a parameter with a known mass or inertia before you use their sizes.",
)

#: The same where the law feeds torques of the description forward, which are in N m by themselves.
_FED_SCALE = replace(
    _SCALE,
    message="No torque was logged. The scale of inertias, friction and gravity is that of the "
    "declared gains and of the description, whose torques the law feeds forward. If all of these "
    "are 10 % too large, so are all parameters, and no test of this record shows it; their "
    "intervals do not contain it.",
)

#: The same where the drive gain is not known.
_RATIO = Finding(
    "warning",
    TOPIC,
    "ratio",
    "No torque was logged, and the drive gain is not known. Positions cannot tell the common scale "
    "of inertias, friction, gravity and gains: every parameter is a ratio to the drive gain, the "
    "same for all joints. Ratios between parameters hold, their sizes in SI units are not known.",
    next_step="Write drive_gain, the joint torque per unit of the law's output, under "
    "[controller]; one known mass or inertia gives it as that value over its estimate.",
)

#: What least squares of a computed torque says.
BIASED = Finding(
    "warning",
    TOPIC,
    "biased",
    "Least squares is biased here by construction: the torque was computed from the measured "
    "positions, so their noise is in it and in the regressor alike, multiplied by the gains.",
    next_step="Compare with cloe.",
)

#: The same of instrumental variables.
EQUATION_ERROR = Finding(
    "warning",
    TOPIC,
    "equation error",
    "The torque was computed from the measured positions and contains their noise, multiplied by "
    "the gains. Instruments are free of it only where they come from the reference alone.",
    next_step="Compare with cloe.",
)


def scale_findings(loop: Loop | None, recordings: Sequence[Recording]) -> tuple[Finding, ...]:
    """What results of recordings whose torque is that of the law have to say.

    Args:
        loop: the loop, or None.
        recordings: the runs.

    Returns:
        Findings; none where every torque was measured.
    """
    computed = [r for r in recordings if r.torque_source == "law"]
    if loop is None or not computed:
        return ()
    known = _SCALE if loop.feed_forward == "none" else _FED_SCALE
    found = [known if loop.gain_known else _RATIO]
    first = computed[0]
    assert first.q_ref is not None, "the torque was computed from it"
    if not isinstance(loop.controller, PythonController):
        law = loop.controller.law(first.rate, first.q_ref[:1], None)
        if joints := [n for n, k in zip(first.joint_names, law.integral_gain, strict=True) if k]:
            found.append(_integrator(joints))
    return tuple(found)


def _integrator(joints: Sequence[str]) -> Finding:
    """What a law that integrates leaves open."""
    text = (
        f"The control law of {listed(joints)} integrates, and what its integrator held at the "
        "first sample was not logged: the computed torque may lack a constant in each recording, "
        "which gravity and offsets take up."
    )
    step = "Begin the log before the controller is switched on, or take the offsets for that."
    return Finding("warning", TOPIC, "integrator", text, next_step=step)
