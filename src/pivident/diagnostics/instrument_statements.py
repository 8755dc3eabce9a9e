"""What the verdict says about feedback and instruments."""

from __future__ import annotations

from collections.abc import Iterator

from pivident.diagnostics.diagnostics import Diagnostics
from pivident.diagnostics.statement import Statement
from pivident.text.lists import listed
from pivident.text.numbers import percent

#: Parameters that differ least squares from instruments are named from so many deviations on.
NAMED_SHIFT = 2.0


def feedback_bias(diagnostics: Diagnostics, name: str) -> Iterator[Statement]:
    """Whether least squares and instruments differ."""
    tests = diagnostics.instruments.get(name) or next(
        reversed(list(diagnostics.instruments.values())), None
    )
    if tests is None:
        yield Statement(
            "feedback",
            "caution",
            "Whether the feedback loop biases least squares cannot be told without instruments: "
            "give the controller, or let it be identified, and run iv or piv.",
        )
        return
    test = tests.exogeneity
    k = max(range(len(test.shift)), key=lambda i: abs(test.shift[i]))
    shifted = [n for n, s in zip(test.names, test.shift, strict=True) if abs(s) > NAMED_SHIFT]
    evidence = (
        f"Durbin-Wu-Hausman, robust: F = {test.statistic:.3g}, p = {test.p_value:.2g}; largest "
        f"shift {abs(test.shift[k]):.2g} σ ({test.names[k]}, "
        f"{percent(100 * abs(test.relative[k]))})"
    )
    if test.matters:
        most = f", most in {listed(shifted)}" if shifted else ""
        text = (
            f"Least squares on the same equations differs significantly{most}: its regressors "
            "share noise or model error with the residual; prefer instruments."
        )
        yield Statement("feedback", "note", text, evidence)
    elif test.rejects:
        text = "Least squares and instruments differ significantly, but hardly in size."
        yield Statement("feedback", "note", text, evidence)
    else:
        text = "Least squares on the same equations would do as well."
        yield Statement("feedback", "good", text, evidence)


def strength(diagnostics: Diagnostics, name: str) -> Iterator[Statement]:
    """Whether the instruments are relevant and not contradicted."""
    tests = diagnostics.instruments.get(name)
    if tests is None:
        return
    relevance = tests.relevance
    evidence = (
        f"smallest first-stage F {relevance.statistic:.3g} (weak below 10), smallest partial R² "
        f"{relevance.practical_size:.4g}, Cragg-Donald {relevance.cragg_donald:.3g}"
    )
    if relevance.weak:
        text = f"The instruments are weak for {listed(relevance.weak)}."
        yield Statement("instruments", "caution", text, evidence)
    else:
        yield Statement("instruments", "good", "The instruments are strong.", evidence)
    more = tests.overidentification
    if more.matters:
        text = (
            "Further instruments contradict the estimate: the model or the control law is not "
            "quite the machine's."
        )
        yield Statement("instruments", "caution", text, str(more))
