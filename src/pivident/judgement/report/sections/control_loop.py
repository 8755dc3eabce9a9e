"""The law and the reference that were found (the paper's Figure 6), and the loop that they make.

The loop of model and law is that of (P-11) to (P-17), with the filters that suit it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from pivident.estimation.control_law.joint_law import JointLaw, differentiator_text
from pivident.estimation.control_law.law_equations import (
    ALWAYS,
    F_PROBABILITY,
    TERMS,
    WORTHWHILE,
    Term,
)
from pivident.estimation.control_law.law_gravity import PLACE_TEXTS, JointGravity
from pivident.estimation.identification import Identification
from pivident.estimation.signal_recipes import Algebraic, Bandpass
from pivident.foundation.document.plot import Figure
from pivident.foundation.text.numbers import format_significant, plus_minus
from pivident.judgement.report.frequency_figures import bandwidth_text, loop_figure
from pivident.judgement.report.identification_figures import law_figure, reference_figure
from pivident.judgement.report.sections.base import Gallery, Section, sampling_rate, signal_recipe
from pivident.judgement.validation.identified_loop import (
    DECIMATION_FACTOR,
    LOWPASS_FACTOR,
    IdentifiedLoop,
    disagreement,
    identified_loop,
    too_slow_smoothers,
)
from pivident.loop.simulation.control_loop import IdentifiedLaw, Loop
from pivident.signals.decimation import decimation_stages

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
                (
                    law,
                    differentiator_text(law.averaged, law.derivative_time, law.derivative_time_std),
                    list(_terms(law, unit)),
                )
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


class ClosedLoopSection(Section):
    """Inertia, bandwidth, T, S and plant of each joint; cut-off frequencies wanted and used."""

    title = "Closed loop and bandwidth"
    anchor = "closed-loop"

    @cached_property
    def loops(self) -> dict[int, IdentifiedLoop]:
        """For each control loop, the last method that simulated it and what it made of it."""
        last = {id(i.loop): k for k, i in enumerate(self.data.identifications) if i.loop}
        made = {k: identified_loop(self.data.identifications[k]) for k in last.values()}
        return {k: own for k, own in sorted(made.items()) if own is not None}

    @property
    def applies(self) -> bool:
        """Only with a method that simulated a loop and still holds it."""
        return bool(self.loops)

    def context(self) -> dict[str, Any]:
        """One entry per control loop."""
        identifications = self.data.identifications
        entries = []
        for k, own in self.loops.items():
            loop = identifications[k].loop
            users = [m for m, i in enumerate(identifications) if i.loop is loop or i.loop is None]
            virtual = loop is not None and loop.reference == "smoothed"
            figures = tuple(loop_figure(j, k) for j in own.joints if j.loop is not None)
            entries.append(
                {
                    "label": self.data.labels[k],
                    "method": k,
                    "found": own,
                    "rows": [(j, j.reason or bandwidth_text(j)) for j in own.joints],
                    "remarks": [] if virtual else list(self._remarks(own, users)),
                    "gallery": Gallery(self.data.labels[k], k, True, (("", figures),)),
                }
            )
        return {
            "entries": entries,
            "several": len(entries) > 1,
            "lowpass": LOWPASS_FACTOR,
            "decimation": DECIMATION_FACTOR,
        }

    def _remarks(
        self, own: IdentifiedLoop, users: Sequence[int]
    ) -> Iterator[tuple[list[tuple[str, int]], bool, str]]:
        """Methods, whether their filters agree with the rule, and a sentence about them."""
        made: dict[tuple[bool, str], list[tuple[str, int]]] = {}
        for k in users if own.fastest is not None else ():
            identification = self.data.identifications[k]
            recipe = signal_recipe(identification)
            if recipe is None or identification.simulation is not None:  # it is filtered by none
                continue
            if isinstance(recipe, Algebraic):  # what its windows take the torque loses too
                continue
            if isinstance(recipe, Bandpass):
                remarks = list(_band_pass_remarks(own, recipe, sampling_rate(identification)))
            else:
                f50 = [joint.f50 for joint in identification.joints]
                remarks = [_smoother_remark(own, f50, recipe.order)]
            for remark in remarks:
                made.setdefault(remark, []).append((self.data.labels[k], k))
        for (agrees, sentence), methods in made.items():
            yield methods, agrees, sentence


def _band_pass_remarks(
    own: IdentifiedLoop, recipe: Bandpass, rate: float
) -> Iterator[tuple[bool, str]]:
    """Whether low-pass and decimation fit the fastest joint."""
    joint = own.fastest
    assert joint is not None
    kept = 0.5 * rate / int(np.prod(decimation_stages(recipe.factor(rate))))
    consequences = (
        (
            "Low-pass of the positions",
            "cutoff",
            float(recipe.cutoffs(len(own.joints))[own.joints.index(joint)]),
            LOWPASS_FACTOR,
            "it may attenuate the fast part of the motion, which biases inertias",
            "more noise than necessary passes into the accelerations",
        ),
        (
            "Decimation",
            "bandwidth",
            kept,
            DECIMATION_FACTOR,
            "it discards part of the motion, which costs accuracy",
            "it keeps frequencies in which there is noise and little motion",
        ),
    )
    for what, option, used, factor, too_low, too_high in consequences:
        wanted, spread = factor * joint.bandwidth, 2.0 * factor * joint.bandwidth_std
        value = plus_minus(wanted, spread)
        rule = (
            f"{factor:g} bandwidths are {value} Hz for {joint.name}, the fastest joint; used were "
            f"{format_significant(used)} Hz"
        )
        side = disagreement(used, wanted, spread)
        if side == 0:
            yield True, f"{what}: {rule}, which agrees within a factor of 1.5."
            continue
        consequence = too_low if side < 0 else too_high
        advice = (
            f"Try {option} = {format_significant(wanted, 2)} and see whether the estimate moves."
        )
        if wanted >= 0.5 * rate:
            most = format_significant(rate)
            advice = f"The record's rate of {most} Hz does not allow it: record faster."
        direction = "lower" if side < 0 else "higher"
        yield False, f"{what}: {rule}, clearly {direction}: {consequence}. {advice}"


def _smoother_remark(own: IdentifiedLoop, f50: Sequence[float], order: int) -> tuple[bool, str]:
    """Whether the smoothers leave the motion alone."""
    slow = too_slow_smoothers(own, f50, order)
    if not slow:
        return True, (
            "Smoother: removes less than a thousandth of the motion up to the bandwidth on every "
            "joint."
        )
    listed = ", ".join(
        f"{name} ({format_significant(used)} Hz, wanted {format_significant(wanted)} Hz)"
        for name, used, wanted in slow
    )
    return False, (
        f"Smoother: removes more than a thousandth of the motion at the bandwidth on {listed}. "
        "That does no harm where the motion itself is slower. Where f50_max is set, raise it and "
        "see whether the estimate moves."
    )
