"""What the verdict says about feedback and instruments."""

from __future__ import annotations

from collections.abc import Iterator

from pivident.estimation.simulation_result import SimulationResult
from pivident.foundation.text.finding import Finding, Quantity, Severity
from pivident.foundation.text.numbers import percent
from pivident.foundation.text.sentences import capital, listed
from pivident.judgement.diagnostics.diagnostics import Diagnostics
from pivident.judgement.validation.instrument_tests import WEAK
from pivident.loop.instruments.given_motion import InstrumentsUsed
from pivident.loop.instruments.kinds import KINDS

#: Parameters that differ least squares from instruments are named from so many standard errors on.
NAMED_SHIFT = 2.0


def feedback_bias(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Whether least squares and instruments differ."""
    simulation = diagnostics.identifications[name].simulation
    if simulation is not None:
        yield _without_measured_motion(simulation)
        return
    tests = diagnostics.instruments.get(name) or next(
        reversed(list(diagnostics.instruments.values())), None
    )
    if tests is None:
        yield Finding(
            "note",
            "feedback",
            "no instruments",
            "Without instruments it is not known whether the feedback loop biases least squares.",
            next_step="Run iv-full-rate or piv beside it.",
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


def _without_measured_motion(simulation: SimulationResult) -> Finding:
    """What feedback does to a fitted simulation."""
    if simulation.loop == "closed":
        text = (
            "The simulated loop is given the reference, no measured position: noise that the "
            "feedback carries does not bias the estimate. A wrong law, reference or delay does."
        )
        return Finding("ok", "feedback", "simulated", text)
    text = (
        "The open loop is driven by the recorded torques. What of their noise does not act on the "
        "robot biases the estimate."
    )
    return Finding("note", "feedback", "recorded torques", text)


def _what_they_cure(used: InstrumentsUsed) -> str:
    """What the instruments are, and which bias they remove and which not."""
    kind = KINDS[used.kind]
    return (
        f"They come from {kind.title}, and remove the bias from {kind.cures}, not that from "
        f"{kind.leaves}."
    )


def strength(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Whether the instruments are relevant and not contradicted."""
    tests = diagnostics.instruments.get(name)
    if tests is None:
        return
    relevance = tests.relevance
    evidence = {
        "F": Quantity(relevance.statistic, bound=WEAK),
        "partial R²": Quantity(relevance.practical_size),
        "Cragg-Donald": Quantity(relevance.cragg_donald),
    }
    basis = (
        f"smallest first-stage F {relevance.statistic:.3g} (weak below {WEAK:g}), smallest "
        f"partial R² {relevance.practical_size:.4g}, Cragg-Donald {relevance.cragg_donald:.3g}"
    )
    used = diagnostics.identifications[name].instruments
    severity: Severity = "ok"
    if relevance.weak:
        severity, kind = "warning", "weak"
        text = f"The instruments are weak for {listed(relevance.weak)}."
    elif used is not None and used.shares_noise:
        severity, kind = "warning", "not exogenous"
        text = f"The instruments may share the noise of the record: {used.shares_noise}."
    elif used is not None and not KINDS[used.kind].exogenous:
        severity, kind = "note", "partly exogenous"
        text = "The instruments are relevant, but no more than partly free of the record's noise."
    else:
        kind, text = "strong", "The instruments are strong."
    if used is not None:
        text += f" {_what_they_cure(used)}"
    step = ""
    if kind != "strong" and used is not None and used.kind != "loop":
        step = "Log the reference of the motion, or repeat the motion."
    yield Finding(severity, "instruments", kind, text, "", step, evidence, basis)
    if used is not None and used.others:
        others = "; ".join(f"{title} ({why})" for title, why in used.others)
        text = f"Other instruments that were considered: {others}."
        yield Finding("note", "instruments", "others", text)
    more = tests.overidentification
    if more.matters:
        with_law = used is None or used.kind == "loop"
        cause = "the model or the control law" if with_law else "the model"
        text = f"{capital(cause)} does not quite match the machine, "
        text += "as tests with other signals show."
        yield Finding("warning", "instruments", "contradicted", text, basis=str(more))
