"""What the verdict says about feedback and instruments."""

from __future__ import annotations

from collections.abc import Iterator

from pivident.diagnostics.diagnostics import Diagnostics
from pivident.text.finding import Finding, Quantity, Severity
from pivident.text.lists import listed
from pivident.text.numbers import percent

#: Parameters that differ least squares from instruments are named from so many standard errors on.
NAMED_SHIFT = 2.0

#: First-stage F below which instruments are weak.
WEAK_BELOW = 10.0


def feedback_bias(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Whether least squares and instruments differ."""
    tests = diagnostics.instruments.get(name) or next(
        reversed(list(diagnostics.instruments.values())), None
    )
    if tests is None:
        yield Finding(
            "warning",
            "feedback",
            "no instruments",
            "Without instruments it is not known whether the feedback loop biases least squares.",
            next_step="Give the controller, or let it be identified, and run iv or piv.",
        )
        return
    test = tests.exogeneity
    k = max(range(len(test.shift)), key=lambda i: abs(test.shift[i]))
    shifted = [n for n, s in zip(test.names, test.shift, strict=True) if abs(s) > NAMED_SHIFT]
    evidence = {
        "F": Quantity(test.statistic),
        "p": Quantity(test.p_value),
        "largest shift": Quantity(float(abs(test.shift[k])), "σ"),
    }
    basis = (
        f"Durbin-Wu-Hausman, robust: F = {test.statistic:.3g}, p = {test.p_value:.2g}; largest "
        f"shift {abs(test.shift[k]):.2g} σ ({test.names[k]}, "
        f"{percent(100 * abs(test.relative[k]))})"
    )
    severity: Severity
    if test.matters:
        most = f", most in {listed(shifted)}" if shifted else ""
        text = (
            f"Least squares on the same equations differs significantly{most}: its regressors "
            "share noise or model error with the residual; prefer instruments."
        )
        severity, kind = "note", "biased"
    elif test.rejects:
        text = "The difference between least squares and instruments is significant but small."
        severity, kind = "note", "hardly biased"
    else:
        text = "Least squares on the same equations would do as well."
        severity, kind = "ok", "not biased"
    yield Finding(severity, "feedback", kind, text, evidence=evidence, basis=basis)


def strength(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Whether the instruments are relevant and not contradicted."""
    tests = diagnostics.instruments.get(name)
    if tests is None:
        return
    relevance = tests.relevance
    evidence = {
        "F": Quantity(relevance.statistic, bound=WEAK_BELOW),
        "partial R²": Quantity(relevance.practical_size),
        "Cragg-Donald": Quantity(relevance.cragg_donald),
    }
    basis = (
        f"smallest first-stage F {relevance.statistic:.3g} (weak below {WEAK_BELOW:g}), smallest "
        f"partial R² {relevance.practical_size:.4g}, Cragg-Donald {relevance.cragg_donald:.3g}"
    )
    if relevance.weak:
        text = f"The instruments are weak for {listed(relevance.weak)}."
        yield Finding("warning", "instruments", "weak", text, evidence=evidence, basis=basis)
    else:
        text = "The instruments are strong."
        yield Finding("ok", "instruments", "strong", text, evidence=evidence, basis=basis)
    more = tests.overidentification
    if more.matters:
        text = (
            "Further instruments contradict the estimate: the model or the control law does not "
            "quite match the machine."
        )
        yield Finding("warning", "instruments", "contradicted", text, basis=str(more))
