"""The verdict: should one believe this result, in plain words, each with its numbers.

A verdict is made of statements in a fixed order: which estimate to take; what is well determined
and what is not; whether the feedback biases least squares; whether the noise model whitens; whether
the instruments are fit for use; how well unseen motion is predicted; and what the residual is made
of. Each statement has a grade and names the test that it stands on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from pivident.consistency.significance import NOTABLE_COST
from pivident.estimation.full_rate import FullRateRecord
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import parameter_rows, percent, significant
from pivident.validation.consistent_estimate import NoConsistentEstimate
from pivident.validation.examination import Examination, examine_alone
from pivident.validation.residual_tests import ResidualTests
from pivident.validation.wanted_motion import wanted_motions

Grade = Literal["good", "note", "caution", "bad"]

#: Number of the layout of ``verdict.json``.
SCHEMA = 1

#: A parameter whose 2σ is below this share of its value is well determined [%].
WELL = 10.0

#: Names listed in one sentence.
LISTED = 8

#: Most doubts about an identified law that are told one by one.
DOUBTS = 3

#: Parameters that differ least squares from instruments are named from so many deviations on.
NAMED_SHIFT = 2.0


#: A step to consistent parameters that is less probable lies outside the intervals.
IMPROBABLE = 0.01


@dataclass(frozen=True)
class Statement:
    """One sentence of the verdict.

    Attributes:
        topic: what it is about.
        grade: ``good``, ``note`` (neither good nor bad), ``caution`` or ``bad``.
        text: in plain words.
        evidence: the test and its numbers.
    """

    topic: str
    grade: Grade
    text: str
    evidence: str = ""

    def __str__(self) -> str:
        mark = {"good": "+", "note": "·", "caution": "!", "bad": "×"}[self.grade]
        return f"{mark} {self.topic}: {self.text}" + (
            f" [{self.evidence}]" if self.evidence else ""
        )


@dataclass(frozen=True)
class Verdict:
    """Should one believe it?

    Attributes:
        method: name of the method whose estimate to take.
        name: its short name.
        statements: in the order of the page.
    """

    method: str
    name: str
    statements: tuple[Statement, ...]

    @property
    def grade(self) -> Grade:
        """The worst grade of all statements."""
        grades = {s.grade for s in self.statements}
        return next((g for g in ("bad", "caution") if g in grades), "good")

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        reservations = sum(s.grade == "caution" for s in self.statements)
        if self.grade == "bad":
            topics = ", ".join(dict.fromkeys(s.topic for s in self.statements if s.grade == "bad"))
            return f"Do not use this result as it is: {topics} (marked ×)."
        if self.grade == "caution":
            many = "one reservation" if reservations == 1 else f"{reservations} reservations"
            return f"Take the estimate of {self.method}, with {many} (marked !)."
        return f"Take the estimate of {self.method}: nothing speaks against it."

    def __str__(self) -> str:
        return "\n".join(["Verdict: " + self.headline, *(f"  {s}" for s in self.statements)])

    def __repr__(self) -> str:
        return f"<Verdict: {self.headline}>"

    def _repr_html_(self) -> str:
        from pivident.report.notebook import verdict_html

        return verdict_html(self)


def verdict(examination: Examination | Identification) -> Verdict:
    """Put what was found out into words.

    Args:
        examination: tests and comparisons; for a result alone the tests that need nothing else.

    Returns:
        Statements in a fixed order, each with a grade and its numbers.
    """
    if isinstance(examination, Identification):
        examination = examine_alone({examination.method: examination})
    name = examination.recommended
    result = examination.identifications[name]
    statements = [
        *_choice(examination, name),
        *_convergence(result),
        *_determined(result),
        *_signs(result),
        *_bias(examination, name),
        *_noise(result, examination.residuals[name]),
        *_lines(result),
        *_instruments(examination, name),
        *_prediction(examination, name),
        *_model(examination),
        *_consistency(examination, name),
        *(Statement("warning", "caution", text) for text in _further_warnings(result)),
        *(Statement("not tested", "note", text) for text in examination.notes),
    ]
    return Verdict(result.method, name, tuple(statements))


def save_verdict(found: Verdict, path: Path) -> None:
    """Write a verdict as JSON.

    Args:
        found: the verdict.
        path: file to write.
    """
    import json

    content = {
        "schema": SCHEMA,
        "method": found.method,
        "grade": found.grade,
        "headline": found.headline,
        "statements": [asdict(s) for s in found.statements],
    }
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _choice(examination: Examination, name: str) -> Iterator[Statement]:
    """Which method to use for this record and why."""
    result, compared = examination.identifications[name], examination.out_of_sample
    if compared is None:
        why = (
            "it is the only one here"
            if len(examination.identifications) == 1
            else "it is the last that converged; nothing was held out to compare them on"
        )
        yield Statement("estimate", "note", f"Take that of {result.method}: {why}.")
        return
    sentences = compared.sentences()
    worse = compared.piv_is_worse
    errors = ", ".join(
        f"{r.method} {percent(r.prediction.total_in_band)}" for r in compared.results.values()
    )
    ratio = next((s for s in sentences if s.startswith("Held-out")), "")
    yield Statement(
        "estimate",
        "caution" if worse else "good",
        " ".join(s for s in sentences if not s.startswith("Held-out")),
        f"torque error on held-out motion: {errors}. {ratio}".strip(),
    )


def _convergence(result: Identification) -> Iterator[Statement]:
    if result.iterations < 2:
        return
    last = f"last change {percent(100.0 * result.history[-1].change)}"
    if result.converged:
        text = f"It converged in {result.iterations} iterations."
        yield Statement("iteration", "good", text, last)
    else:
        text = (
            f"It did not converge in {result.iterations} iterations; this is not an estimate yet."
        )
        yield Statement("iteration", "bad", text, last)


def _determined(result: Identification) -> Iterator[Statement]:
    """What is well determined, what is not, and which motion would determine it."""
    rows = parameter_rows(result)
    well = [r for r in rows if 2.0 * r.relative_std <= WELL]
    zero = tuple(r.name for r in rows if r.includes_zero)
    middle = tuple(r.name for r in rows if 2.0 * r.relative_std > WELL and not r.includes_zero)
    best = min(rows, key=lambda r: r.relative_std)
    worst = max(rows, key=lambda r: r.relative_std)
    evidence = (
        f"2σ from {percent(2 * best.relative_std)} ({best.name}) to "
        f"{percent(2 * worst.relative_std)} ({worst.name}); condition number "
        f"{significant(result.condition)}"
    )
    text = f"{len(well)} of {len(rows)} parameters are known to {WELL:g} % or better (2σ)"
    if not (zero or middle):
        yield Statement("parameters", "good", f"All {text.split(' of ')[1]}.", evidence)
        return
    parts = [text]
    if middle:
        parts.append(f"less well {_listed(middle)}")
    if zero:
        parts.append(f"not told apart from zero, which they may be: {_listed(zero)}")
    grade: Grade = "caution" if len(zero) > len(rows) // 4 else "note"
    yield Statement("parameters", grade, "; ".join(parts) + ".", evidence)
    for sentence in wanted_motions(result, zero or middle):
        yield Statement("motion", "note", sentence)


def _signs(result: Identification) -> Iterator[Statement]:
    """Friction and rotor inertias cannot be negative."""
    negative = [
        f"{row.name} = {significant(row.value)} ± {significant(2 * row.std, 2)} {row.unit}"
        for row, parameter in zip(parameter_rows(result), result.parameters, strict=True)
        if parameter.is_dissipative and row.value < 0
    ]
    certain = [
        row.name
        for row, parameter in zip(parameter_rows(result), result.parameters, strict=True)
        if parameter.is_dissipative and row.value + 2.0 * row.std < 0
    ]
    if not negative:
        return
    text = "Negative, as no friction or rotor inertia can be"
    if certain:
        yield Statement("physics", "bad", f"{text}: {', '.join(certain)}.", "; ".join(negative))
    else:
        text = "Negative, but not told apart from zero"
        yield Statement("physics", "note", f"{text}: {_listed(negative)} (2σ).")


def _bias(examination: Examination, name: str) -> Iterator[Statement]:
    """Whether least squares and instruments differ."""
    tests = examination.instruments.get(name) or next(
        reversed(list(examination.instruments.values())), None
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
        listed = f", most in {_listed(tuple(shifted))}" if shifted else ""
        text = (
            f"Least squares on the same equations differs significantly{listed}: its regressors "
            "share noise or model error with the residual; prefer instruments."
        )
        yield Statement("feedback", "note", text, evidence)
    elif test.rejects:
        text = "Least squares and instruments differ significantly, but hardly in size."
        yield Statement("feedback", "note", text, evidence)
    else:
        text = "Least squares on the same equations would do as well."
        yield Statement("feedback", "good", text, evidence)


def _noise(result: Identification, tests: ResidualTests) -> Iterator[Statement]:
    """Whether the noise model whitens, and what else the residual tells."""
    whiteness = tests.of("whiteness")
    worst = tests.worst("whiteness")
    if worst is None:
        return
    coloured = tuple(joint for joint, test in whiteness if test.matters)
    modelled = any(j.ar_order for j in result.joints)
    what = "The noise model whitens the residual" if modelled else "The residual is white"
    evidence = f"{worst[0]}: {worst[1]}"
    own = result.covariance is result.robust_covariance
    if not coloured:
        yield Statement("noise", "good", f"{what} on all joints.", evidence)
    else:
        rest = (
            "the deviations allow for that"
            if own
            else "the method's own deviations do not allow for that: look at the robust ones"
        )
        if modelled and _continues_level(result):
            rest += (
                ". On measured records it leaves the motion's own frequencies alone, where the "
                "residual is mostly model error"
            )
        what = "The noise model does not whiten" if modelled else "The residual is coloured"
        text = f"{what}{' the residual' if modelled else ''} on {_listed(coloured)}; {rest}."
        yield Statement("noise", "note" if own else "caution", text, evidence)
    for topic, sentence in (
        ("variance", "The residual's variance changes with the motion on {joints}"),
        ("motion", "The motion explains part of what the model left on {joints}"),
    ):
        matter = tuple(joint for joint, test in tests.of(topic) if test.matters)
        most = tests.worst(topic)
        if matter and most is not None:
            text = sentence.format(joints=_listed(matter)) + "."
            yield Statement("noise", "note", text, f"{most[0]}: {most[1]}")


def _lines(result: Identification) -> Iterator[Statement]:
    """Spectral lines of the encoders, which the smoother has taken into account."""
    records = () if result.equations is None else result.equations.records
    units = dict(zip((j.name for j in result.joints), _position_units(result), strict=True))
    found = {
        f"{joint} at {significant(line.frequency)} Hz, {significant(line.std, 2)} {units[joint]}"
        for r in records
        if isinstance(r, FullRateRecord)
        for joint, lines in zip(units, r.kinematics.lines, strict=False)
        for line in lines
    }
    if found:
        text = "The encoders' noise has spectral lines, which the smoother has taken into account"
        yield Statement("encoders", "note", f"{text}: {_listed(sorted(found))}.")


def _position_units(result: Identification) -> list[str]:
    return ["rad" if joint.kind == "revolute" else "m" for joint in result.robot.joints]


def _continues_level(result: Identification) -> bool:
    """Whether the noise level beyond the motion's band was continued into it."""
    equations = result.equations
    noise = result.options.get("noise")
    if equations is None or not isinstance(noise, dict) or noise.get("motion_band") is None:
        return False
    records = [r for r in equations.records if isinstance(r, FullRateRecord)]
    return any(not r.kinematics.recording.simulated for r in records)


def _instruments(examination: Examination, name: str) -> Iterator[Statement]:
    """Whether the instruments are relevant and not contradicted."""
    tests = examination.instruments.get(name)
    if tests is None:
        return
    relevance = tests.relevance
    evidence = (
        f"smallest first-stage F {relevance.statistic:.3g} (weak below 10), smallest partial R² "
        f"{relevance.practical_size:.4g}, Cragg-Donald {relevance.cragg_donald:.3g}"
    )
    if relevance.weak:
        text = f"The instruments are weak for {_listed(relevance.weak)}."
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


def _prediction(examination: Examination, name: str) -> Iterator[Statement]:
    """How well unseen motion is predicted."""
    compared = examination.out_of_sample
    if compared is None or name not in compared.results:
        yield Statement(
            "prediction",
            "caution",
            "Judged on the motion that was fitted only: hold blocks out, or give a second "
            "recording.",
            f"torque error {percent(100 * examination.identifications[name].relative_error)}",
        )
        return
    judged = compared.results[name]
    error, fitted = judged.prediction, judged.training
    evidence = (
        f"below {error.band:g} Hz {percent(error.total_in_band)} on {len(judged.held_out)} "
        f"held-out blocks, {percent(fitted.total_in_band)} on the fitted motion"
    )
    grows = error.total_in_band / max(fitted.total_in_band, 1e-300)
    if judged.replay is not None:
        evidence += f"; simulated loop {percent(judged.replay.total)}"
    text = f"Torque of motion that was not fitted is predicted to {percent(error.total_in_band)}"
    if grows > 1.5:
        text += f", {grows:.1f} times worse than that of the fitted motion: fewer parameters, or "
        text += "more motion"
    yield Statement("prediction", "caution" if grows > 1.5 else "good", f"{text}.", evidence)


def _model(examination: Examination) -> Iterator[Statement]:
    """Model error told apart from noise."""
    split = examination.model_error
    if split is None:
        return
    sentences = split.sentences()
    grade: Grade = "note" if split.mostly_model_error else "good"
    yield Statement("residual", grade, " ".join(sentences))


def _consistency(examination: Examination, name: str) -> Iterator[Statement]:
    """Whether a real machine can have these parameters."""
    made = examination.consistent
    found = made.get(name) or next(reversed(list(made.values())), None)
    if found is None:
        return
    if isinstance(found, NoConsistentEstimate):
        yield Statement("physics", "caution", f"{found.label}: {found.reason}.")
        return
    model, prediction = found.model, found.prediction
    cost = model.torque_cost if prediction is None else prediction.cost
    if model.was_consistent:
        text = "A real machine can have exactly these parameters."
        yield Statement("physics", "good", text, f"{found.label} has the same torques")
        return
    evidence = (
        f"least distance {significant(model.least_distance, 2)} σ, p = {model.p_value:.2g}; "
        f"distance of those taken {significant(model.distance, 2)} σ"
    )
    if prediction is not None:
        evidence += f"; {prediction}"
    elif math.isfinite(cost):
        evidence += f"; torque error on the fitted record, relative change {100 * cost:+.2g} %"
    if held_back := found.held_back():
        evidence += f"; held back most by {held_back[0]}"
    take = f"take {found.label} for simulation and export"
    near, cheap = model.p_value > IMPROBABLE, cost <= NOTABLE_COST
    if not math.isfinite(cost):
        where = "within" if near else "outside"
        text = (
            f"Parameters that a real machine can have lie {where} the intervals; what they cost in "
            "torque is not known without torque sums or held-out motion: identify again to have "
            "them."
        )
        yield Statement("physics", "note" if near else "caution", text, evidence)
    elif near and cheap:
        text = f"Parameters that a real machine can have lie within the intervals: {take}."
        yield Statement("physics", "good", text, evidence)
    elif cheap:
        text = (
            "The nearest parameters that a real machine can have lie outside the intervals, which "
            f"do not know all model error, but predict as well: {take}."
        )
        yield Statement("physics", "note", text, evidence)
    else:
        text = (
            "The nearest parameters that a real machine can have predict worse than the estimate: "
            "geometry, friction law or a bound is not the machine's."
        )
        yield Statement("physics", "caution", text, evidence)


def _further_warnings(result: Identification) -> Iterator[str]:
    """The estimator's warnings that no statement above repeats; many of one law are one."""
    found = None if result.loop is None else result.loop.identified
    of_law = () if found is None or len(found.warnings) <= DOUBTS else tuple(found.warnings)
    for text in result.warnings:
        if text in of_law or text.startswith(("Not converged", "Exogeneity")):
            continue
        yield text
    if of_law:
        yield (
            f"The control law found from the record leaves {len(of_law)} doubts (all of them in "
            f"the summary of the report), and the instruments rest on it. The first: {of_law[0]} "
            'Give the law where it is known, or compare with type = "virtual_pd".'
        )


def _listed(names: tuple[str, ...] | list[str]) -> str:
    shown = ", ".join(names[:LISTED])
    return shown if len(names) <= LISTED else f"{shown} and {len(names) - LISTED} more"
