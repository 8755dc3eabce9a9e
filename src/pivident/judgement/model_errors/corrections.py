"""Causes of model error estimated with the parameters: `pivident identify --free geometry,delay`.

The correction s of some causes and the parameters θ are estimated in turn. With the last estimate,

    (θ, δ) = (Yᵀ X)⁻¹ Yᵀ τ,    s ← s + δ

on the rows of `cause_rows`, robot and recordings are corrected by s, and the method is run again,
until δ is a tenth of its standard error. What is not known of s is not known of θ either. With
G = -∂θ/∂s, and P the covariance that the method gives for the corrected problem,

    cov θ = P + G cov(s) Gᵀ

Friction that changes with a temperature is corrected wherever recordings have one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.friction import FrictionWarming
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.method import Method
from pivident.estimation.methods import method_named
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding, Quantity, Severity
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.text.sentences import listed
from pivident.foundation.threads import linear_algebra_in_one_thread
from pivident.judgement.model_errors.cause import Cause
from pivident.judgement.model_errors.named_causes import alternatives, is_found, score_tests
from pivident.judgement.model_errors.score_tests import ScoreTests
from pivident.judgement.model_errors.time_errors import WARMTH
from pivident.robot.naming import nearest

#: Kinds of causes that a size corrects.
CORRECTED = (
    "delay", "geometry", "gear ratio", "torque gain", "zero position", "position scale", "encoder",
    "encoder coupling", "wrench frame", "wrench gain",
)  # fmt: skip

#: What to do about the others.
INSTEAD = {
    "friction": "`pivident laws` finds a law",
    "uneven friction": "`pivident friction` shows it over the position",
    "elasticity": "`pivident flexibility` identifies the joint",
    "missing parameter": "estimate it, too ([identify] parameters)",
    "backlash": "its size alone does not correct it",
    "torque ripple": "its size alone does not correct it",
    "warming up": "log temperatures ([identify] temperature), or identify shorter parts of the "
    "record",
    WARMTH: "name the columns of temperature ([identify] temperature), which corrects it",
    "offset drift": "identify shorter parts of the record",
    "offset jump": "identify the parts before and after it apart",
    "load drift": "identify shorter parts of the record",
    "load jump": "identify the parts before and after it apart",
    "clock": "correct the rate of the recording",
    "spring": "describe it as a term of the joint's friction",
    "payload": "identify the recordings apart",
    "coupled joints": "describe the loop, the gear or the motor that ties them",
}

#: Change of a correction, in standard errors, below which it has settled, and after some rounds:
#: noise models of two orders may take turns, and move it to and fro.
SETTLED, TAKING_TURNS, SOME_ROUNDS = 0.1, 0.5, 5

#: Rounds after which corrections that do not settle are given up.
MAX_ROUNDS = 8

#: Most causes of the kinds asked for that are corrected together, but for one of each joint.
MOST = 8


@dataclass(frozen=True, eq=False)
class Corrections(Displayed):
    """Causes that were corrected.

    Attributes:
        problem: robot and recordings with all of them corrected.
        causes: what was corrected.
        size: by how much, each in the unit of its cause, one after the other, shape (columns,).
        covariance: of ``size``, shape (columns, columns).
        alike: other causes that the record cannot tell from one of them, by its words.
        left_out: temperatures that do not explain the friction of their joints.
    """

    problem: Problem
    causes: tuple[Cause, ...]
    size: np.ndarray
    covariance: np.ndarray
    alike: Mapping[str, tuple[Cause, ...]] = field(default_factory=dict)
    left_out: tuple[Cause, ...] = ()

    def on(self, recordings: Sequence[Recording]) -> tuple[Recording, ...]:
        """Other recordings of the same machine, corrected likewise."""
        if not self.causes or not recordings:
            return tuple(recordings)
        other = replace(self.problem, recordings=recordings, weights=None)
        return tuple(_corrected(other, self.causes, self.size).recordings)

    def of(self, cause: Cause) -> tuple[np.ndarray, np.ndarray]:
        """Size of one cause and its standard errors, each (columns,)."""
        first = sum(c.count for c in self.causes[: self.causes.index(cause)])
        own = slice(first, first + cause.count)
        return self.size[own], np.sqrt(np.diag(self.covariance))[own]

    @property
    def friction_warming(self) -> tuple[FrictionWarming, ...]:
        """Changes of friction with temperature, one for each joint that has one."""
        names = self.problem.robot.joint_names
        own = [(cause, x) for cause in self.causes if (x := cause.reference) is not None]
        return tuple(
            FrictionWarming(
                cause.subject, reference, tuple(name for name, _ in cause.parts),
                *(tuple(x.tolist()) for x in self.of(cause)),
            )
            for cause, reference in sorted(own, key=lambda pair: names.index(pair[0].subject))
        )  # fmt: skip

    def findings(self) -> tuple[Finding, ...]:
        """A note on each correction with its interval; a warning where another one may be right."""
        found = [
            Finding("note", "correction", c.kind, f"The friction of {c.subject} does not follow "
                    f"its {c.what}, and is not corrected.", c.subject)
            for c in self.left_out
        ]  # fmt: skip
        for cause in self.causes:
            size, std = (x.tolist() for x in self.of(cause))
            number = range(1, cause.count + 1)
            named = [(f"size {k}" if cause.count > 1 else "size", cause.unit) for k in number]
            parts = list(zip(cause.parts or named, size, std, strict=True))
            values = " and ".join(
                f"{f'{name} by ' * bool(cause.parts)}{plus_minus(x, 2.0 * s)} {unit}"
                for (name, unit), x, s in parts
            )
            said = not cause.subject or cause.what.endswith(f" {cause.subject}")
            whose = "" if said else f" of {cause.subject}"
            words = f"{cause.what}{whose}, {{size}}"
            words = (cause.phrase if cause.parts else words).replace("{size}", values)
            text = f"Corrected with the estimate: {words}."
            evidence = {
                name: Quantity(x, unit, interval=(x - 2 * s, x + 2 * s))
                for (name, unit), x, s in parts
            }
            severity: Severity = "note"
            if others := self.alike.get(str(cause)):
                severity = "warning"
                text += (
                    f" The record cannot tell it from {listed([str(c) for c in others], 3)}, and "
                    "the parameters depend on which is right."
                )
            subject = cause.subject
            found.append(
                Finding(severity, "correction", cause.kind, text, subject, evidence=evidence)
            )
        return tuple(found)


def kinds_of(names: Sequence[str]) -> tuple[str, ...]:
    """Kinds of causes as they are typed, ``gear-ratio`` for ``gear ratio``, in words."""
    return tuple(name.strip().lower().replace("-", " ").replace("_", " ") for name in names)


def corrections(
    problem: Problem,
    method: Method | str,
    kinds: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Corrections:
    """Estimate the causes of some kinds that the record shows, together with the parameters.

    A delay of all torques is estimated whenever it is asked for; of the other kinds, those causes
    that are significant. Friction that changes with temperature is asked for by recordings that
    have one.

    Args:
        problem: what is given.
        method: how the parameters are estimated.
        kinds: ``delay``, ``geometry``, ``gear ratio``, ``torque gain``, ``zero position``,
            ``position scale``, ``encoder`` or ``encoder coupling``.
        progress: called with one line at each stage.

    Returns:
        The corrected problem, and the corrections with their covariance.

    Raises:
        IdentificationError: an unknown kind, one that no size corrects, or corrections that do not
            settle.
    """
    say = progress or (lambda line: None)
    _check_kinds(kinds)
    kinds = (*kinds, WARMTH)
    method = method_named(method)
    chosen: list[Cause] = []
    size = np.zeros(0)
    alike: dict[str, tuple[Cause, ...]] = {}
    for round_ in range(MAX_ROUNDS):
        corrected = _corrected(problem, chosen, size)
        found = identify(corrected, method)
        with linear_algebra_in_one_thread():
            tests = score_tests(corrected, found, kinds)
            numbers = [_number(tests, cause) for cause in chosen]
            added = _further(tests, numbers, alike)
        numbers += added
        chosen += [tests.causes[k] for k in added]
        known = {str(cause) for cause in chosen}
        left_out = tuple(c for c in tests.causes if c.kind == WARMTH and str(c) not in known)
        if not chosen:
            return Corrections(problem, (), size, np.zeros((0, 0)), left_out=left_out)
        step, covariance, shown = _step(tests, numbers)
        size = np.concatenate([size, np.zeros(step.size - size.size)]) + step
        change = float(np.max(np.abs(step[shown]) / np.sqrt(np.diag(covariance)[shown])))
        say(f"corrections, round {round_ + 1}: they change by {change:.2g} σ")
        if not added and change < (SETTLED if round_ < SOME_ROUNDS else TAKING_TURNS):
            last = _corrected(problem, chosen, size)
            return Corrections(last, tuple(chosen), size, covariance, alike, left_out)
    raise IdentificationError(
        f"the corrections of {', '.join(str(c) for c in chosen)} do not settle in {MAX_ROUNDS} "
        "rounds",
        advice="free fewer kinds at a time",
    )


def with_corrections(found: Identification, made: Corrections) -> Identification:
    """An estimate of the corrected problem, whose intervals know what is not known of the sizes.

    cov θ = P + G cov(s) Gᵀ.

    Args:
        found: estimate of ``made.problem`` by any method.
        made: the corrections.

    Returns:
        The estimate with wider intervals and a note on each correction; itself without any.
    """
    if not made.causes:
        notes = made.findings()
        return replace(found, warnings=(*notes, *found.warnings)) if notes else found
    tests = score_tests(made.problem, found, [cause.kind for cause in made.causes])
    numbers = [_number(tests, cause) for cause in made.causes]
    columns = tests.columns(numbers)
    shown = np.isin(_all_columns(tests, numbers), columns)
    gain = tests.sensitivity(columns)
    more = gain @ made.covariance[np.ix_(shown, shown)] @ gain.T
    return replace(
        found,
        covariance=found.covariance + more,
        robust_covariance=found.robust_covariance + more,
        friction_warming=made.friction_warming,
        warnings=(*made.findings(), *found.warnings),
    )


def _corrected(problem: Problem, causes: Sequence[Cause], size: np.ndarray) -> Problem:
    """The problem with some causes corrected by their sizes."""
    first = 0
    for cause in causes:
        assert cause.correct is not None
        problem = cause.correct(problem, size[first : first + cause.count])
        first += cause.count
    return problem


def _all_columns(tests: ScoreTests, numbers: Sequence[int]) -> np.ndarray:
    """All columns of some causes, also those that others hide."""
    return np.concatenate([tests.of(k) for k in numbers])


def _step(tests: ScoreTests, numbers: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """δ of some causes, its covariance, and which columns are shown; the hidden ones stay zero."""
    columns, every = tests.columns(numbers), _all_columns(tests, numbers)
    own, shown = slice(tests.sums.parameters, None), np.isin(every, columns)
    step, covariance = np.zeros(every.size), np.zeros((every.size, every.size))
    try:
        found, of_found = tests.estimate(numbers)
        step[shown], covariance[np.ix_(shown, shown)] = found[own], of_found[own, own]
    except np.linalg.LinAlgError:
        raise IdentificationError(
            f"{', '.join(str(tests.causes[k]) for k in numbers)}: all that tells some of these "
            "corrections apart lies within one short stretch of the record",
            advice="free fewer kinds at a time",
        ) from None
    return step, covariance, shown


def _number(tests: ScoreTests, cause: Cause) -> int:
    """Number of a cause among those of another robot or record, where it has the same name."""
    return next(k for k, other in enumerate(tests.causes) if str(other) == str(cause))


def _further(
    tests: ScoreTests, corrected: Sequence[int], alike: dict[str, tuple[Cause, ...]]
) -> list[int]:
    """Causes to be corrected besides: the delay of all torques, and those that are significant.

    ``alike`` gets those that cannot be told from one of them.
    """
    added = [
        k
        for k, cause in enumerate(tests.causes)
        if cause.kind == "delay" and not cause.subject and k not in corrected
    ]
    while len(corrected) + len(added) < max(MOST, len(tests.sums.variance)):
        _, scores = tests.all_scores([*corrected, *added], 0.0)
        able = {
            k: s
            for k, s in scores.items()
            if tests.causes[k].correct is not None and is_found(s, tests.tried)
        }
        if not able:
            break
        best = max(able, key=lambda k: able[k].unseen)
        added.append(best)
        if tests.causes[best].kind != WARMTH:  # one joint's temperature is not that of another
            alike[str(tests.causes[best])] = tuple(
                score.cause for score in alternatives(able[best], able.values())
            )
    return added


def _check_kinds(kinds: Sequence[str]) -> None:
    """Refuse kinds that no size corrects, before anything is estimated."""
    for kind in kinds:
        if kind in INSTEAD:
            raise IdentificationError(
                f"free: {kind} cannot be corrected with the estimate",
                advice=f"{INSTEAD[kind]}. These can: {', '.join(CORRECTED)}",
            )
        if kind not in CORRECTED:
            known = (*CORRECTED, *INSTEAD)
            raise IdentificationError(f"free: unknown kind {kind!r}", advice=nearest(kind, known))
