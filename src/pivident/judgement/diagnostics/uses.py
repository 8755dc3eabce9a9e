"""What a result is good for: torque, simulation, single parameters, bodies; each with its evidence.

Each use has a question of its own and a baseline of its own, so that a mass that is not known does
not speak against torques that fit:

========== ============================================ ====================================
use        evidence                                      baseline
========== ============================================ ====================================
torque     error on motion that was not fitted           description, plain law, no torque
simulation parameters that a machine can have            fit error of the nearest machine
parameters intervals                                     –
bodies     distance of consistent masses, their sum      masses of the description
========== ============================================ ====================================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from pivident.dynamics.signs import negative_parameters
from pivident.estimation.parameter_rows import parameter_rows
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.numbers import format_significant, percent
from pivident.foundation.text.plain_values import NOT_STORED
from pivident.foundation.text.sentences import half_sentence, listed, plural
from pivident.judgement.diagnostics.consistent_estimate import ConsistentEstimate
from pivident.judgement.diagnostics.diagnostics import Diagnostics
from pivident.judgement.diagnostics.estimate_statements import is_known
from pivident.judgement.diagnostics.prediction_statements import unexplained_joints
from pivident.judgement.validation.held_out.prediction import PredictionError
from pivident.models.consistency.consistent_model import ConsistentModel

Answer = Literal["yes", "care", "no"]

#: Ratio to the smaller error of description and plain law up to which an estimate is as good, and
#: from which it is worse.
AS_GOOD, WORSE = 1.05, 1.25

#: Error below which nothing is gained by a smaller one, and difference of errors that costs nothing
#: [% of the torque].
NEGLIGIBLE = 1.0

#: Growth of the fit error of a machine's parameters that counts as none.
AS_WELL = 0.02

#: Share of parameters that are known, from which on single values may be used.
MOSTLY_KNOWN, HARDLY_KNOWN = 0.75, 0.1

#: Total mass of an estimate over that of the description, within which they agree.
MASS = 1.25


@dataclass(frozen=True)
class Use:
    """One use of a result.

    Attributes:
        name: ``torque``, ``simulation``, ``parameters`` or ``bodies``.
        answer: ``yes``, ``care`` or ``no``.
        why: the reason, a clause; empty where there is nothing to say.
        evidence: numbers by name, the decisive one first.
    """

    name: Annotated[str, NOT_STORED]
    answer: Answer
    why: str = ""
    evidence: Mapping[str, Quantity] = field(default_factory=dict)


def uses(diagnostics: Diagnostics, name: str) -> tuple[Use, ...]:
    """What a result is good for.

    Args:
        diagnostics: tests and comparisons.
        name: of the result.
    """
    return (
        torque(diagnostics, name),
        simulation(diagnostics, name),
        parameters(diagnostics, name),
        bodies(diagnostics, name),
    )


def torque(diagnostics: Diagnostics, name: str) -> Use:
    """Feed-forward and collision detection: torque on motion that was not fitted."""
    result, judged = diagnostics.identifications[name], diagnostics.validations.get(name)
    if not result.converged:
        return Use("torque", "no", "the iteration did not converge")
    if judged is None or judged.training_only:
        error = Quantity(100.0 * float(result.relative_error), "%")
        return Use("torque", "care", "no motion was held out", {"fitted motion": error})
    e = judged.prediction
    errors = {"error": e.total_in_band, **diagnostics.baselines.errors, "no torque": 100.0}
    evidence = {key: Quantity(value, "%") for key, value in errors.items()}
    answer, why = _against_baselines(diagnostics, e, errors)
    return Use("torque", answer, why, evidence)


def _against_baselines(
    diagnostics: Diagnostics, e: PredictionError, errors: Mapping[str, float]
) -> tuple[Answer, str]:
    """Whether the error is smaller than that of simpler models, and of every joint."""
    error, described, plain = errors["error"], errors.get("description"), errors.get("plain law")
    first = next((trial for trial in diagnostics.trials if trial.wins), None)
    if first is not None:
        return "no", f"{half_sentence(first.cause)} ({first.effect})"
    moving = min(error, e.total_moving_in_band)
    if moving >= 100.0:
        return "no", "no torque at all would be nearer"
    simpler = [
        (described, "the model of the description"),
        (plain, "plain viscous and Coulomb friction"),
    ]
    known = [(other, what) for other, what in simpler if other is not None]
    if known and error > NEGLIGIBLE:
        least, what = min(known)
        if error > AS_GOOD * least:
            answer: Answer = "no" if error > max(WORSE * least, least + NEGLIGIBLE) else "care"
            return answer, f"{what} misses less, {percent(least)}"
    if missed := unexplained_joints(e):
        said = listed([f"{joint} ({percent(x)})" for joint, x in missed.items()], 3)
        return "care", f"a large error is unexplained: {said}"
    return "yes", ""


def simulation(diagnostics: Diagnostics, name: str) -> Use:
    """Simulation and control design: a machine can have the parameters."""
    result, model = diagnostics.identifications[name], _nearest_machine(diagnostics, name)
    if not result.converged:
        return Use("simulation", "no", "the iteration did not converge")
    if model is None:
        certain = [
            p.name
            for p in negative_parameters(result.parameters, result.names, result.theta, result.std)
            if p.is_certain
        ]
        if certain:
            return Use("simulation", "no", f"{listed(certain)} cannot be negative")
        return Use("simulation", "care", "whether a machine can have the parameters is not known")
    evidence = {
        "distance": Quantity(model.least_distance, "σ"),
        "fit error": Quantity(100.0 * model.torque_error_free, "%"),
        "of the nearest machine": Quantity(100.0 * model.torque_error, "%"),
    }
    grows = model.torque_error / max(model.torque_error_free, 1e-300) - 1.0
    larger = f"{percent(100.0 * grows)} larger"
    fits = f"torque error {'as small' if grows < AS_WELL else larger}"
    if model.was_consistent:
        return Use("simulation", "yes", "", evidence)
    if model.is_far:
        why = f"no machine has these parameters (the nearest possible ones: {fits})"
        return Use("simulation", "no", why, evidence)
    why = f"the exported model, which is physically possible ({fits})"
    return Use("simulation", "care", why, evidence)


def parameters(diagnostics: Diagnostics, name: str) -> Use:
    """Single values, to compare them over time and between robots."""
    rows = parameter_rows(diagnostics.identifications[name])
    known = sum(is_known(row) for row in rows)
    evidence = {"known to 10 %": Quantity(known), "parameters": Quantity(len(rows))}
    why = f"{known} of {plural(len(rows), 'value')} known to 10 %"
    share = known / max(len(rows), 1)
    answer: Answer = "yes" if share >= MOSTLY_KNOWN else "care" if share >= HARDLY_KNOWN else "no"
    return Use("parameters", answer, why, evidence)


def bodies(diagnostics: Diagnostics, name: str) -> Use:
    """Masses and centres of mass of single bodies, as in a URDF."""
    model = _nearest_machine(diagnostics, name)
    if model is None:
        return Use("bodies", "no", "no consistent masses are known")
    if model.is_far:
        return Use("bodies", "no", "no machine has these parameters")
    mass, described = sum(b.mass for b in model.links), diagnostics.baselines.described_mass
    evidence = {"mass": Quantity(mass, "kg"), "distance": Quantity(model.least_distance, "σ")}
    if not described:
        return Use("bodies", "care", "only sums of masses follow from torques", evidence)
    evidence["description"] = Quantity(described, "kg")
    said = f"{format_significant(mass)} kg in all, {format_significant(described)} as described"
    agrees = 1.0 / MASS < mass / described < MASS
    return Use("bodies", "yes" if agrees and model.was_consistent else "care", said, evidence)


def _nearest_machine(diagnostics: Diagnostics, name: str) -> ConsistentModel | None:
    """The consistent parameters that were asked for, else those nearest to the estimate."""
    made = diagnostics.consistent.get(name)
    return made.model if isinstance(made, ConsistentEstimate) else diagnostics.nearest


def with_errors(judged: Sequence[Use], statements: Sequence[Finding]) -> tuple[Use, ...]:
    """The same uses; none where a statement says that the estimate is wrong.

    Args:
        judged: uses.
        statements: of the verdict.
    """
    errors = (s for s in statements if s.severity == "error" and s.topic != "iteration")
    wrong = next(errors, None)
    return tuple(
        replace(use, answer="no", why=half_sentence(wrong.message))
        if wrong is not None and not wrong.repairs and use.name == "torque"
        else use
        for use in judged
    )


def answers(judged: Sequence[Use]) -> list[str]:
    """What a result is good for, in one or two sentences.

    Args:
        judged: its uses.
    """
    by_name = {use.name: use for use in judged}
    own, loop = by_name.get("torque"), by_name.get("simulation")
    if own is None or loop is None:
        return []
    why = f": {own.why}" if own.why else ""
    if own.answer == "no":
        return [f"Do not use it for torque prediction{why}."]
    also = " and simulation" if loop.answer == "yes" else ""
    if own.answer == "care":
        first = f"Good for torque prediction{also} with care{why}."
    else:
        first = f"Good for torque prediction{also}."
    if also:
        return [first]
    return [first, f"{'Not for' if loop.answer == 'no' else 'For'} simulation: {loop.why}."]
