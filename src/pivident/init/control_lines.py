"""Controller and methods: what runs best with what is known of the loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pivident.init.assumption import Assumption

if TYPE_CHECKING:
    from pivident.init.recording_lines import RecordingLines
    from pivident.init.trial import Findings


def control_lines(found: RecordingLines, findings: Findings) -> list[Assumption]:
    """Lines of ``[controller]``, ``[identify]`` and ``[validation]``."""
    lines: list[Assumption] = []
    law = law_to_try(found, findings)
    example = '"pd"\n# kp = [1000.0, 800.0]\n# kd = [50.0, 40.0]'
    if law == "identify":
        seen = "the control law is unknown, but the log has a reference: it is identified from that"
        seen += f"{findings.law_found}"
        lines.append(
            Assumption("controller", "type", law, "likely", seen, "Known gains are better.")
        )
    else:
        reason = findings.law_failed or "the control law is not known and the log has no reference"
        if found.link_torques:
            reason = "the control law drives the motors, which torques behind the gears do not show"
        seen = f"{reason}: no loop is simulated, instruments come from the record itself"
        lines.append(Assumption("controller", "type", None, "likely", seen, example=example))
    methods = [m for m in ("ls", "iv-full-rate", "piv") if m not in findings.failed]
    seen = "least squares beside instrumental variables, whose difference is the bias of the "
    seen += "loop; the verdict says which to take"
    if findings.instruments:
        seen += f". Instruments: {findings.instruments}"
    if findings.failed:
        seen += ". " + ". ".join(f"{m} is left out: {why}" for m, why in findings.failed.items())
    lines.append(Assumption("identify", "methods", methods, "likely", seen))
    if findings.folds is not None:
        seen = "the record is too short, or its rate too low, for more blocks of held-out motion"
        seen += "; 0: errors are those of the fitted motion"
        lines.append(Assumption("validation", "folds", findings.folds, "certain", seen))
    return lines


def law_to_try(found: RecordingLines, findings: Findings) -> str | None:
    """``identify`` where the log has a reference and that has not failed yet, or none."""
    if found.link_torques or findings.law_failed or not found.has_reference:
        return None
    return "identify"
