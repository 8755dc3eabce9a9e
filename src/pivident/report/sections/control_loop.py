"""The law and the reference that were found from the record: the paper's Figure 6."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pivident.control_law.joint_law import JointLaw
from pivident.control_law.law_equations import ALWAYS, F_PROBABILITY, TERMS, WORTHWHILE, Term
from pivident.control_law.law_gravity import PLACE_TEXTS, JointGravity
from pivident.control_law.law_table import differentiator_text
from pivident.estimation.identification import Identification
from pivident.report.plotly_figures import Figure, law_figure, reference_figure
from pivident.report.sections.base import Gallery, Section
from pivident.simulation.control_loop import IdentifiedLaw, Loop

#: What each gain multiplies, and its unit with that of the position for {}.
_MEANING: dict[Term, tuple[str, str]] = {
    "kp": ("e, error of the position", "u per {}"),
    "kd": ("−D q, measured speed", "u per {}/s"),
    "speed_reference": ("D q_ref, speed of the reference", "u per {}/s"),
    "ki": ("∫e, integral of the error", "u per {} s"),
    "acceleration_reference": ("D² q_ref, acceleration of the reference", "u per {}/s²"),
    "offset": ("1, a constant", "u"),
    "position_gain": ("e, in the speed setpoint", "1/s"),
    "speed_gain": ("setpoint less speed (its inverse: inputs in the setpoint)", "u per {}/s"),
    "integral_gain": ("its integral, times the speed gain", "1/s"),
    "delay": ("how much later the setpoint arrives", "s"),
}


class ControlLoopSection(Section):
    """Gains, differentiator and fit of each joint's law; how far the reference can be trusted."""

    title = "Control loop"
    anchor = "control-loop"

    @property
    def applies(self) -> bool:
        """Only where a law was identified or a reference reconstructed."""
        return bool(self.data.loops)

    def context(self) -> dict[str, Any]:
        """One entry per loop, with the methods that simulated it."""
        return {
            "entries": [self._entry(loop, methods) for loop, methods in self.data.loops],
            "several": self.data.several,
            "probability": F_PROBABILITY,
            "worthwhile": WORTHWHILE,
        }

    def _entry(self, loop: Loop, methods: Sequence[int]) -> dict[str, Any]:
        """Tables and figures of one loop, with the signals of the last method that used it."""
        user = self.data.identifications[methods[-1]]
        robot, driven = user.robot.on_fixed_base, user.joints[user.robot.base_joints :]
        units = [joint.position_unit for joint in robot.joints]
        gains = np.broadcast_to(np.asarray(loop.drive_gain, float), (robot.size,))
        laws = loop.identified.joints if loop.identified is not None else ()
        return {
            "method": methods[-1],
            "methods": [(self.data.labels[k], k) for k in methods],
            "recordings": loop.identified.recordings if loop.identified is not None else (),
            "drives": [
                (gain, joint.torque_unit) for gain, joint in zip(gains, driven, strict=True)
            ],
            "compensates": any(law.gravity is not None for law in laws),
            "laws": [
                (law, differentiator_text(*_differentiator(law)), list(_terms(law, unit)))
                for law, unit in zip(laws, units, strict=False)
            ],
            "feedback": [
                (own, differentiator_text(own.averaged), unit)
                for own, unit in zip(loop.feedback, units, strict=False)
            ],
            "compared": loop.identified.compared if loop.identified is not None else "output",
            "unit": loop.identified.unit if loop.identified is not None else "u",
            "output": self._law_gallery(loop.identified, methods[-1]),
            "references": [
                (
                    recording.name,
                    own,
                    list(zip(user.joints, own.rms, own.relative, units, strict=True)),
                )
                for recording, own in zip(user.recordings, loop.reconstructed, strict=False)
            ],
            "positions": self._reference_gallery(loop, user, methods[-1]),
            "left_out_names": [r.name for r in user.recordings[self.data.shown_recordings :]],
        }

    def _law_gallery(self, found: IdentifiedLaw | None, method: int) -> Gallery:
        """One figure per joint, of the first recording."""
        figures: tuple[Figure, ...] = ()
        if found is not None:
            figures = tuple(
                law_figure(found, joint, method, self.data.points)
                for joint in range(len(found.joints))
            )
        return self._gallery(method, [("", figures)] if figures else [])

    def _reference_gallery(self, loop: Loop, user: Identification, method: int) -> Gallery:
        """One figure per joint and recording."""
        titled = len(user.recordings) > 1
        drawn = self.data.drawn(user.recordings) if loop.reconstructed else ()
        groups = [
            (
                recording.name if titled else "",
                tuple(
                    reference_figure(user, recording, joint, method, self.data.points)
                    for joint in range(user.robot.size)
                ),
            )
            for recording in drawn
            if recording.q_ref is not None
        ]
        return self._gallery(method, groups)

    def _gallery(self, method: int, groups: list[tuple[str, tuple[Figure, ...]]]) -> Gallery:
        return Gallery(self.data.labels[method], method, True, tuple(groups))


def _differentiator(law: JointLaw) -> tuple[bool, float, float]:
    return law.averaged, law.derivative_time, law.derivative_time_std


def _terms(law: JointLaw, position: str) -> Iterator[dict[str, Any]]:
    """Terms in use, then those rejected."""
    tried = [term for term in TERMS if term not in law.terms and term in law.f_tests]
    for term in (*law.terms, *tried):
        meaning, unit = _MEANING[term]
        statistic = law.f_tests.get(term, np.nan)
        used = term in law.terms
        yield {
            "name": term,
            "meaning": meaning,
            "unit": unit.format(position),
            "gain": law.gain(term) if used else None,
            "std": float(law.std[law.terms.index(term)]) if used else np.nan,
            "statistic": statistic,
            # F = (gained/left) × degrees of freedom
            "taken": statistic / (statistic + law.samples),
            "verdict": _verdict(law, term),
        }
    if law.gravity is not None:
        yield from _weights(law.gravity)


def _weights(gravity: JointGravity) -> Iterator[dict[str, Any]]:
    """The parameters of the law's gravity model; the F-test is that of all of them together."""
    where = "q" if gravity.place == "gravity" else "q_ref"
    for p, value, std in zip(gravity.parameters, gravity.values, gravity.std, strict=True):
        yield {
            "name": f"gravity, {p.name}",
            "meaning": f"∂g/∂{p.name} at {where}, the {PLACE_TEXTS[gravity.place]}",
            "unit": p.unit,
            "gain": float(value),
            "std": float(std),
            "statistic": gravity.statistic,
            "taken": gravity.taken,
            "verdict": "accepted",
        }


def _verdict(law: JointLaw, term: Term) -> str:
    """How a term came into the law, or did not."""
    if term in ALWAYS:
        return "always"
    if term not in law.f_tests:
        return "given"
    return "accepted" if term in law.terms else "rejected"
