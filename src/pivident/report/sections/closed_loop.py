"""The loop that model and law make: the paper's (P-11) to (P-17), and the filters that suit it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from pivident.estimation.methods import Algebraic, Bandpass
from pivident.report.frequency_figures import bandwidth_text, loop_figure
from pivident.report.recipes import sampling_rate, signal_recipe
from pivident.report.sections.base import Gallery, Section
from pivident.signals.decimation import decimation_stages
from pivident.text.numbers import format_significant, plus_minus
from pivident.validation.identified_loop import (
    DECIMATION_FACTOR,
    LOWPASS_FACTOR,
    IdentifiedLoop,
    disagreement,
    identified_loop,
    too_slow_smoothers,
)


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
                remarks = _band_pass_remarks(own, recipe, sampling_rate(identification))
            else:
                f50 = [joint.f50 for joint in identification.joints]
                remarks = [_smoother_remark(own, f50, recipe.order)]
            for remark in remarks:
                made.setdefault(remark, []).append((self.data.labels[k], k))
        for (agrees, sentence), methods in made.items():
            yield methods, agrees, sentence


def _band_pass_remarks(
    own: IdentifiedLoop, recipe: Bandpass, rate: float
) -> list[tuple[bool, str]]:
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
    remarks = []
    for what, option, used, factor, too_low, too_high in consequences:
        wanted, spread = factor * joint.bandwidth, 2.0 * factor * joint.bandwidth_std
        value = plus_minus(wanted, spread)
        rule = (
            f"{factor:g} bandwidths are {value} Hz for {joint.name}, the fastest joint; used were "
            f"{format_significant(used)} Hz"
        )
        side = disagreement(used, wanted, spread)
        if side == 0:
            remarks.append((True, f"{what}: {rule}, which agrees within a factor of 1.5."))
            continue
        consequence = too_low if side < 0 else too_high
        advice = (
            f"Try {option} = {format_significant(wanted, 2)} and see whether the estimate moves."
        )
        if wanted >= 0.5 * rate:
            most = format_significant(rate)
            advice = f"The record's rate of {most} Hz does not allow it: record faster."
        direction = "lower" if side < 0 else "higher"
        remarks.append((False, f"{what}: {rule}, clearly {direction}: {consequence}. {advice}"))
    return remarks


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
