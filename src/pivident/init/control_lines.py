"""Controller and methods: what runs best with what is known of the loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pivident.init.assumption import Assumption

if TYPE_CHECKING:
    from pivident.init.recording_lines import RecordingLines
    from pivident.init.trial import Findings

#: Sampling rate below which a declared control law hardly carries a simulation [Hz].
SLOWEST_LOOP = 200.0


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
    elif law == "virtual_pd":
        seen = findings.law_failed or "the control law is not known and the log has no reference"
        seen += ": a declared law follows the smoothed motion; results say so"
        lines.append(
            Assumption("controller", "type", law, "likely", seen, "Known gains are better.")
        )
    else:
        reason = findings.loop_failed or (
            f"the control law is not known, and {found.rate:.4g} Hz are too slow for a declared one"
        )
        seen = f"{reason}: instrumental variables cannot be had; complete this table where the "
        seen += "law is known"
        lines.append(Assumption("controller", "type", None, "likely", seen, example=example))
    if law is None:
        methods = ["ls"]
        seen = "least squares needs no controller. Where the log was taken in a feedback loop its "
        seen += "estimates may be biased"
    else:
        methods = [m for m in ("ls", "iv-full-rate", "piv") if m not in findings.failed]
        seen = "least squares beside instrumental variables, whose difference is the bias of the "
        seen += "loop; the verdict says which to take"
        if findings.failed:
            seen += ". " + ". ".join(
                f"{m} is left out: {why}" for m, why in findings.failed.items()
            )
    lines.append(Assumption("identify", "methods", methods, "likely", seen))
    return lines


def law_to_try(found: RecordingLines, findings: Findings) -> str | None:
    """The best control law that has not failed yet: ``identify``, ``virtual_pd`` or none."""
    if findings.loop_failed:
        return None
    if found.has_reference and not findings.law_failed:
        return "identify"
    return "virtual_pd" if found.rate >= SLOWEST_LOOP else None
