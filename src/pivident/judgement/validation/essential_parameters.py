"""Essential parameters: the smallest set that explains the torques as well as all of them.

Backward elimination (Janot, Vandanjon and Gautier 2014). The parameter with the largest relative
standard error is left out if zero is compatible with it, by the Wald form

    W = θ_i² / σ_i²  against  F(1, ν),                                        (single)
    W = θ₂ᵀ (d P₂₂)⁻¹ θ₂ / k  against  F(k, r/d - b),                          (all k left out)

and so on with the next one, until the first rejection. For least squares the second line is the F
ratio of residual sums; IV does not minimise such a sum, so the Wald form is used for all.

What decides is σ. With r = 200,000 rows of a residual that is not white, formula standard errors
are ten times too small and everything is "significant". σ_i is therefore taken from the sandwich
over windows of time, with ν its degrees of freedom, and the joint test counts r/d rows, where the
design effect d is the mean ratio of sandwich to formula variances. On the public TX40 record d is
about 120 with PIV; of 61 parameters there remain the laboratory's 28, give or take two that are
three standard errors large. By formula standard errors 58 would remain.

Leaving parameters out changes the others by θ₁ - P₁₂ P₂₂⁻¹ θ₂, which needs no new identification;
one follows after each round, and ends the search when nothing more can go.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.estimation.identification import Identification, joint_weights
from pivident.estimation.identify import identify, narrowed
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Method
from pivident.estimation.methods import method_named
from pivident.estimation.problem import Problem
from pivident.foundation.errors import (
    ExperimentError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import format_significant, plain_table, with_spread
from pivident.judgement.validation.elimination import (
    Elimination,
    EliminationRound,
    design_effect,
    torque_error,
    torque_sums,
)

#: Probability with which a parameter that is zero stays in. Sixty tests are made of one record:
#: on simulated TX40 records one of 33 zero parameters stays at 5 %, next to none at 1 %.
ALPHA = 0.01


@dataclass(frozen=True, eq=False)
class EssentialParameters(Displayed):
    """What is left, what went and why.

    Attributes:
        identification: of the essential parameters.
        full: of all parameters that the search started from.
        steps: the parameters left out, in order.
        spared: parameters whose own test would have removed them, but which are the last friction
            term of their joint.
        alpha: significance level of the tests.
        design_effect: d, sandwich over formula variances of the full identification.
        effective_samples: r/d, number of independent equations that the rows are worth.
        largest_change: largest change of a parameter at the last identification, compared with
            what was foretold without it [σ].
        error_before: relative torque error with all parameters, over all joints, each weighted
            by its own error [%].
        error_after: with the essential ones, with the same weights [%].
        stopped: why the search ended, a sentence.
        notes: further sentences.
    """

    identification: Identification
    full: Identification
    steps: tuple[Elimination, ...]
    spared: tuple[str, ...]
    alpha: float
    design_effect: float
    effective_samples: float
    largest_change: float
    error_before: float
    error_after: float
    stopped: str
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the essential parameters."""
        return self.identification.names

    @property
    def dropped(self) -> tuple[str, ...]:
        """Names of the others, in the order in which they were left out."""
        return tuple(step.name for step in self.steps)

    def __str__(self) -> str:
        return "\n\n".join([self.summary(), self.history_table()])

    def summary(self) -> str:
        """Counts, torque errors and the end, in a few lines."""
        lines = [
            f"Essential parameters by {self.identification.method}: {len(self.names)} of "
            f"{len(self.full.names)}; relative torque error {self.error_before:.2f} % with all, "
            f"{self.error_after:.2f} % with these.",
            f"The rows correspond to {self.effective_samples:.0f} independent equations (variances "
            f"are {format_significant(self.design_effect)} times those of a white residual).",
            self.stopped,
            *self.notes,
        ]
        if self.spared:
            lines.append(
                f"Kept as the last friction of their joint: {', '.join(self.spared)}, although not "
                "significantly different from zero."
            )
        return "\n".join(lines)

    def history_table(self) -> str:
        """The parameters left out, one line each."""
        if not self.steps:
            return "No parameter was left out."
        spreads = [with_spread(s.value, 2.0 * s.std) for s in self.steps]
        return plain_table(
            [
                ("left out", "<", [s.name for s in self.steps]),
                ("round", ">", [str(s.round) for s in self.steps]),
                ("value", ".", [value for value, _ in spreads]),
                ("±2σ", ".", [spread for _, spread in spreads]),
                ("unit", "<", [s.unit for s in self.steps]),
                ("W", ".", [format_significant(s.statistic, 2) for s in self.steps]),
                ("p", ".", [f"{s.p_value:.3f}" for s in self.steps]),
                ("p of all", ".", [f"{s.joint_p_value:.3f}" for s in self.steps]),
                ("error before %", ".", [f"{s.error_before:.3f}" for s in self.steps]),
                ("after %", ".", [f"{s.error_after:.3f}" for s in self.steps]),
            ]
        )


def essential_parameters(
    problem: Problem,
    method: Method | str = "piv",
    *,
    alpha: float = ALPHA,
    reidentify: Literal["round", "step"] = "round",
    progress: Callable[[str], None] | None = None,
) -> EssentialParameters:
    """Leave out, one at a time, the parameters that the record does not ask for.

    A joint keeps at least one friction parameter. Where the loop cannot be simulated with the
    full set, whose surplus parameters may make an impossible mass matrix, a round by least
    squares comes first.

    Args:
        problem: what is given; its parameters are the set that the search starts from.
        method: a method or its name in ``METHODS``.
        alpha: probability with which a zero parameter is kept.
        reidentify: ``round``: a new identification when nothing more can go by the foretold
            change, until one more round removes nothing; ``step``: after every parameter.
        progress: called with one line at each stage.

    Returns:
        The parameters that are left, their estimate, and the history of what went and why.

    Raises:
        ExperimentError: an impossible alpha, or an unknown choice.
        IdentificationError: what ``identify`` raises.
    """
    if not 0 < alpha < 1:
        raise ExperimentError(f"alpha must lie between 0 and 1, not {alpha}")
    if reidentify not in ("round", "step"):
        raise ExperimentError(f"reidentify is {reidentify!r}", advice="choose 'round' or 'step'")
    say = progress or (lambda line: None)
    chosen = method_named(method)
    most = 1 if reidentify == "step" else len(problem.names)
    notes: list[str] = []
    steps: list[Elimination] = []
    change = 0.0
    try:
        found = full = identify(problem, chosen, say)
    except (MassMatrixNotPositiveDefinite, SimulationDiverged) as error:
        if not chosen.simulates_loop:
            raise
        found = full = identify(problem, LeastSquares(), say)
        notes.append(
            f"With all {len(problem.names)} parameters the loop cannot be simulated ({error}); "
            "the first round is by least squares."
        )
    problem = narrowed(problem, full)
    while True:
        number = len({s.round for s in steps}) + 1
        elimination = EliminationRound(found, full, number, alpha, most)
        say(f"round {number}: {len(elimination.steps)} of {len(found.names)} parameters left out")
        steps += elimination.steps
        switched = bool(notes) and found is full
        if not elimination.steps and not switched:
            break
        problem = problem.estimating(elimination.names)
        found = identify(problem, chosen, say)
        change = float(np.max(np.abs(found.theta - elimination.theta) / found.free_std))
    return EssentialParameters(
        identification=found,
        full=full,
        steps=tuple(steps),
        spared=elimination.spared,
        alpha=alpha,
        design_effect=(effect := design_effect(full)),
        effective_samples=sum(j.rows for j in full.joints) / effect,
        largest_change=change,
        error_before=torque_error(torque_sums(full), full.theta, joint_weights(full)),
        error_after=torque_error(torque_sums(found), found.theta, joint_weights(full)),
        stopped=elimination.stopped,
        notes=tuple(notes),
    )
