"""What the signals were filtered with: the paper's Figure 3, and the smoothers of the others."""

from __future__ import annotations

from typing import Any

from pivident.estimation.identification import Identification
from pivident.estimation.signal_recipes import Algebraic, Bandpass, Decimated, RandomWalk
from pivident.foundation.document.plot import Figure
from pivident.judgement.report.frequency_figures import (
    bandpass_figure,
    decimation_figure,
    smoother_figure,
    window_figure,
)
from pivident.judgement.report.sections.base import Section, sampling_rate, signal_recipe


class FiltersSection(Section):
    """Band-pass and decimation, or the smoother, of each recipe with the methods that used it."""

    title = "Filters of the signals"
    anchor = "filters"

    @property
    def applies(self) -> bool:
        """Only where a result holds its equations."""
        return any(_key(i) is not None for i in self.data.identifications)

    def context(self) -> dict[str, Any]:
        """One entry per recipe, in the order of the methods."""
        users: dict[Any, list[int]] = {}
        for k, identification in enumerate(self.data.identifications):
            key = _key(identification)
            if key is not None:
                users.setdefault(key, []).append(k)
        entries = []
        for methods in users.values():
            identification = self.data.identifications[methods[-1]]
            entries.append(
                {
                    "methods": [(self.data.labels[k], k) for k in methods],
                    "figures": _figures(identification, methods[-1]),
                    "lines": _joints_with_lines(identification),
                    "fitted": [k for k in methods if self.data.identifications[k].simulation],
                    "twice": getattr(signal_recipe(identification), "passes", 1) > 1,
                }
            )
        return {"entries": entries, "several": self.data.several}


def _key(identification: Identification) -> tuple[Any, ...] | None:
    """What two methods with the same filters have in common; None where there is nothing to show.

    The smoother's bandwidth is searched, so its recipe alone does not say.
    """
    recipe = signal_recipe(identification)
    method = identification.method_used
    if method is not None and not method.filters_positions:
        return None
    if isinstance(recipe, Decimated):
        return recipe, sampling_rate(identification)
    if isinstance(recipe, RandomWalk) and _known_f50(identification):
        f50 = tuple(f"{joint.f50:.6g}" for joint in identification.joints)
        return recipe, sampling_rate(identification), f50
    return None


def _known_f50(identification: Identification) -> bool:
    rate = sampling_rate(identification)
    return any(0.0 < joint.f50 <= 0.5 * rate for joint in identification.joints)


def _figures(identification: Identification, method: int) -> tuple[Figure, ...]:
    recipe, rate = signal_recipe(identification), sampling_rate(identification)
    names = [joint.name for joint in identification.joints]
    if isinstance(recipe, Bandpass):
        return (
            bandpass_figure(recipe, names, rate, method),
            decimation_figure(recipe, rate, method),
        )
    if isinstance(recipe, Algebraic):
        return (
            window_figure(recipe, names, rate, method),
            decimation_figure(recipe, rate, method),
        )
    assert recipe is not None
    f50 = [joint.f50 for joint in identification.joints]
    return (smoother_figure(names, f50, recipe.order, rate, method),)


def _joints_with_lines(identification: Identification) -> list[str]:
    """Joints whose smoother also takes out spectral lines of the encoder."""
    assert identification.equations is not None
    found = [
        {j for j, lines in enumerate(record.kinematics.lines) if lines}
        for record in identification.equations.records
    ]
    names = identification.robot.joint_names
    return [names[j] for j in sorted(set().union(*found))]
