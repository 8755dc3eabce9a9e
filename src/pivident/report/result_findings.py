"""What a careful colleague would remark about a result, in whole sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import (
    CONTRADICTION,
    aligned_rows,
    largest_difference,
    parameter_rows,
)
from pivident.text.numbers import percent
from pivident.validation.residuals.residual_tests import ResidualTests

#: Robust deviations larger than the method's own by this factor contradict them.
_TOO_NARROW = 2.0

#: Names listed in one sentence.
_LISTED = 8


def findings(identification: Identification, tests: ResidualTests) -> tuple[str, ...]:
    """Remarks on one result: the estimator's own warnings first.

    Args:
        identification: the result.
        tests: of its residuals.
    """
    return (
        *identification.warnings,
        *_about_convergence(identification),
        *_about_parameters(identification),
        *_about_noise(identification, tests),
    )


def disagreements(identifications: Sequence[Identification], labels: Sequence[str]) -> str | None:
    """Which parameters two methods contradict each other on, None where there are none.

    Args:
        identifications: results of several methods.
        labels: their names.
    """
    apart = []
    for name, rows in aligned_rows(identifications).items():
        distance, i, j = largest_difference(rows)
        if distance > CONTRADICTION:
            apart.append((distance, f"{name} ({labels[i]} and {labels[j]})"))
    if not apart:
        return None
    names = [text for _, text in sorted(apart, reverse=True)]
    return (
        f"Two methods differ by more than {CONTRADICTION:g} combined standard deviations on "
        f"{_listed(names)}; at least one of their intervals is too narrow."
    )


def _about_convergence(identification: Identification) -> Iterator[str]:
    if not identification.converged:
        changes = [percent(100.0 * i.change) for i in identification.history[-1:]]
        last = f" (last change {changes[0]})" if changes else ""
        yield (
            f"The iteration did not converge within {identification.iterations} passes{last}; "
            "these values are not an estimate yet."
        )


def _about_parameters(identification: Identification) -> Iterator[str]:
    rows = parameter_rows(identification)
    undetermined = [row.name for row in rows if row.includes_zero]
    if undetermined:
        yield (
            f"{len(undetermined)} of {len(rows)} parameters are not told apart from zero, "
            f"which their ±2σ includes: {_listed(undetermined)}."
        )
    negative = [
        row.name
        for row, parameter in zip(rows, identification.parameters, strict=True)
        if parameter.is_dissipative and row.value + 2.0 * row.std < 0.0
    ]
    if negative:
        yield f"Negative, as no friction or rotor inertia can be: {_listed(negative)}."
    narrow = sum(row.robust_std > _TOO_NARROW * row.std for row in rows)
    if narrow:
        yield (
            f"For {narrow} of {len(rows)} parameters the robust standard deviation is more than "
            f"{_TOO_NARROW:g} times the method's own; trust the robust one."
        )


def _about_noise(identification: Identification, tests: ResidualTests) -> Iterator[str]:
    bound = [joint.name for joint in identification.joints if joint.ar_at_bound]
    if bound:
        yield (
            f"Noise models of the largest order allowed: {_listed(bound)}; "
            "a larger one might fit better."
        )
    correlated = [joint for joint, test in tests.of("whiteness") if test.matters]
    if correlated:
        yield (
            f"Residuals that are not white: {_listed(correlated)}. "
            f"{_about_deviations(identification)}"
        )


def _about_deviations(identification: Identification) -> str:
    """What correlated residuals mean for the reported standard deviations."""
    if identification.covariance is identification.robust_covariance:
        return (
            "The standard deviations allow for that (they come from windows of time), but a truer "
            "model of friction, elasticity or noise would make them smaller."
        )
    return "The method's own standard deviations assume that they are; trust the robust ones."


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_LISTED])
    return shown if len(names) <= _LISTED else f"{shown} and {len(names) - _LISTED} more"
