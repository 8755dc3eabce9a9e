"""Model error against noise: which part of the residual would come again?

On real machines most of the residual is what the model misses, and standard errors that take it for
noise are wrong. Two ways to separate them:

* a *repeated* motion (periodic reference, or two recordings of the same one): what repeats is model
  error, what does not is noise, see ``pivident.data.recording.repeated_motion``;
* *held-out blocks* otherwise: the prediction error is compared with what the noise level just
  beyond the motion's highest frequency would give. This is coarser: model error that reaches
  beyond that frequency counts as noise, and the estimate's own error counts as model error.

Both are judged below the motion's highest frequency, where the estimate is decided. The noise's
share has an interval from the scatter of the blocks, cut off at 0 and 100 %. Where that reaches
from little to most, the record does not separate noise from model error, and this is reported.

Standard errors from noise alone say how well the estimate would repeat, not how near it is to the
truth. A result holds both, and says which is which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pivident.data.recording.repeated_motion import RepeatedMotion, repeated_motion
from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.equation_record import EquationRecord, accumulate
from pivident.estimation.identification import Identification
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.problem import Problem, torque_units
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.document.table import Column, Table
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.numbers import format_significant, with_spread
from pivident.foundation.text.sentences import listed
from pivident.judgement.validation.held_out.cross_validation import CrossValidation
from pivident.judgement.validation.held_out.prediction import at_rest, motion_band
from pivident.loop.motion.motion import torque_of, usable_samples
from pivident.signals.bandpass import butterworth

#: Blocks of the motion that are left out in turn for the standard error of a share.
BLOCKS = 20

#: An interval of a share that reaches from below the first to above the second says nothing.
LITTLE, MOST = 0.25, 0.75


@dataclass(frozen=True)
class JointModelError:
    """One joint's residual, split below the motion's highest frequency."""

    name: str  # name of the joint
    unit: str  # N m or N
    residual: float  # rms of the residual [unit]
    noise: float  # rms of the part that does not repeat [unit]
    model: float  # rms of the part that does [unit]
    noise_share: float  # share of the noise in the residual's variance, 0 to 1
    share_std: float  # standard error of that share, NaN where there is too little for one
    #: Share of the noise over all frequencies; NaN for held-out blocks.
    noise_share_all: float = np.nan

    @property
    def share_interval(self) -> tuple[float, float]:
        """The share ± 2σ as far as a share can be, within 0 to 1; NaN without a standard error."""
        reach = 2.0 * self.share_std
        low, high = np.clip([self.noise_share - reach, self.noise_share + reach], 0.0, 1.0)
        return float(low), float(high)

    @property
    def is_reported(self) -> bool:
        """Whether noise is separated from model error: not if it may be little as well as most."""
        low, high = self.share_interval
        return not (low < LITTLE and high > MOST)


@dataclass(frozen=True, eq=False)
class ModelError:
    """The residual split into model error and noise."""

    method: str  # whose residual it is
    source: Literal["repetition", "held-out blocks"]  # ``repetition`` or ``held-out blocks``
    description: str  # what was compared, in words
    band: float  # highest frequency of the motion [Hz]
    joints: tuple[JointModelError, ...]  # the split of each joint
    identification: Identification  # the estimate
    #: Standard errors from the noise alone, shape (parameters,): by how much estimates from
    #: repetitions of this record would differ. None where it is not known.
    repeatability: np.ndarray | None = None

    @property
    def noise_share(self) -> float:
        """Share of the noise over all joints, each counted alike, 0 to 1."""
        return float(np.mean([j.noise_share for j in self.joints]))

    @property
    def mostly_model_error(self) -> bool:
        """Whether less than half is noise, by two standard errors."""
        spread = np.sqrt(np.nansum([j.share_std**2 for j in self.joints])) / len(self.joints)
        return self.noise_share + 2.0 * float(spread) < 0.5

    def __str__(self) -> str:
        tables = [table.text() for table in (self.joint_table(), *self.parameter_tables())]
        return "\n\n".join([*self.sentences(), *tables])

    def sentences(self) -> list[str]:
        """What was found, in words with numbers."""
        separated = [j for j in self.joints if j.is_reported]
        unclear = [j for j in self.joints if not j.is_reported]
        lines = [self._separated(separated)] if separated else []
        lines += [self._unclear(unclear)] if unclear else []
        shares = [100.0 * j.noise_share_all for j in self.joints]
        if not np.isnan(shares).any():
            most = "" if len(shares) == 1 else f" to {max(shares):.0f}"
            lines.append(f"Over all frequencies noise accounts for {min(shares):.0f}{most} %.")
        if self.repeatability is not None:
            total = self.identification.std
            free = total > 0.0  # a fixed value has no standard error
            alone = np.maximum(self.repeatability[free], 1e-300)
            ratio = np.exp(np.mean(np.log(total[free] / alone)))
            lines.append(
                "Repeatability: if this record were taken again, the estimates would differ by the "
                "standard errors from noise alone, which do not show how close they are to the "
                "truth. Those that include the model error are "
                f"{format_significant(float(ratio), 2)} times as large."
            )
        if self.mostly_model_error:
            advice = "longer or quieter record would change little; a better model would."
            together = "Over all joints less than half is noise: a " if unclear else "A "
            lines.append(f"{together}{advice}")
        return lines

    def _separated(self, joints: Sequence[JointModelError]) -> str:
        """The least and the largest share among the joints that separate it."""
        low, high = (f(joints, key=lambda j: j.noise_share) for f in (min, max))
        most, whole, rest = "", "residual", "repeats with the motion: it is model error"
        if self.source == "held-out blocks":
            most, whole, rest = "at most ", "error", "is model error and the estimate's own error"
        where = f" on {low.name} and {most}{_share(high)} on {high.name}" if low is not high else ""
        return (
            f"Below {self.band:g} Hz, noise accounts for {most}{_share(low)} of the {whole}'s "
            f"variance{where}; the rest {rest} ({self.description})."
        )

    def _unclear(self, joints: Sequence[JointModelError]) -> str:
        """Joints of which the record says nothing, with the interval that shows it."""
        some = len(joints) < len(self.joints)
        where = f" on {listed([j.name for j in joints])}" if some else ""
        motion = "held-out" if self.source == "held-out blocks" else "repeated"
        low = 100.0 * min(j.share_interval[0] for j in joints)
        high = 100.0 * max(j.share_interval[1] for j in joints)
        basis = "" if some else f" ({self.description})"
        return (
            f"Below {self.band:g} Hz, the {motion} motion does not distinguish noise from model "
            f"error{where}: noise may account for {low:.0f} to {high:.0f} % of the variance "
            f"(2σ){basis}."
        )

    def joint_table(self) -> Table:
        """One row for each joint."""
        joints = self.joints
        columns = {
            "joint": Column([j.name for j in joints]),
            "rms": _column([j.residual for j in joints], f"rms < {self.band:g} Hz"),
            "model_error": _column([j.model for j in joints], "model error"),
            "noise": _column([j.noise for j in joints], "noise"),
            "unit": Column([j.unit for j in joints]),
        }
        values, intervals = zip(*map(_percentages, joints), strict=True)
        columns["noise_share"] = Column(values, "noise, % of variance", align=".")
        columns["interval"] = Column(intervals, "2σ", align=">")
        return Table("joints", columns, title="Model error and noise joint by joint")

    def parameter_tables(self) -> list[Table]:
        """Both kinds of standard errors side by side, where they are known."""
        if self.repeatability is None:
            return []
        found = self.identification
        alone, total = 2.0 * self.repeatability, 2.0 * found.std
        columns = {
            "parameter": Column(found.names),
            "value": Column(found.theta, spread=alone, spread_title="repeats ±2σ"),
            "total": Column(total, "with model error ±2σ", digits=2),
            "unit": Column(found.units),
        }
        return [Table("repeatability", columns, title="Standard errors from noise alone")]


def _column(values: Sequence[float], title: str) -> Column:
    return Column(np.array(values, dtype=float), title, digits=3)


def model_error_by_repetition(
    problem: Problem, identification: Identification, *, period: int | None = None
) -> ModelError:
    """Split the residual of an estimate by what repeats."""
    records = _full_rate_records(identification)
    kinematics = (
        [r.kinematics for r in records]
        if records
        else [estimate_kinematics(r, RandomWalk()) for r in problem.recordings]
    )
    motion = repeated_motion([k.recording for k in kinematics], period)
    theta = identification.theta
    models = [torque_of(problem.regressor, k, theta) for k in kinematics]
    residuals = [k.tau - m for k, m in zip(kinematics, models, strict=True)]
    used = [r.used for r in records] if records else [usable_samples(k) for k in kinematics]
    _, noise, _ = motion.split(residuals, [usable_samples(k) for k in kinematics])
    band = motion_band(problem.recordings[0])
    joints = _splits(problem, motion, residuals, used, band)
    repeatability = None
    if records:
        assert identification.equations is not None
        alone = [r.with_torque(m + v) for r, m, v in zip(records, models, noise, strict=True)]
        equations = identification.equations
        sums = accumulate(problem.regressor, alone, equations.filters)
        covariance = sandwich(sums, theta, equations.variance, equations.weight_power)
        repeatability = np.sqrt(np.diag(covariance))
    return ModelError(
        identification.method, "repetition", motion.description, band, joints, identification,
        repeatability,
    )  # fmt: skip


def model_error_by_held_out_blocks(validation: CrossValidation) -> ModelError:
    """Split the prediction error on held-out motion, below the motion's highest frequency.

    What a joint at rest adds to it is neither: dry friction holds it with any torque, which no
    better model would know.
    """
    errors = [h.prediction for h in validation.held_out if h.prediction is not None]
    band = errors[0].band
    seen = "the fitted data" if validation.training_only else "motion that was not fitted"
    if any(at_rest(e) for e in errors):
        seen += ", without standstill"
    joints = []
    for j, (name, unit) in enumerate(zip(errors[0].joint_names, errors[0].units, strict=True)):
        moving = [e.samples * (e.rms_in_band[j] ** 2 - e.rest_in_band[j] ** 2) for e in errors]
        total = np.maximum(moving, 0.0)
        noise = np.minimum([e.samples * e.noise_in_band[j] ** 2 for e in errors], total)
        joints.append(_joint(name, unit, noise, total, sum(e.samples for e in errors)))
    return ModelError(
        validation.method,
        "held-out blocks",
        f"errors on {seen}, compared with the noise level just above {band:g} Hz",
        band,
        tuple(joints),
        validation.identification,
    )


def model_error(
    problem: Problem, identification: Identification, validation: CrossValidation | None = None
) -> ModelError | None:
    """By repetition where the motion repeats, by held-out blocks otherwise.

    Result: the split; None where nothing repeats and nothing was held out.
    """
    try:
        return model_error_by_repetition(problem, identification)
    except IdentificationError:
        if validation is None or validation.training_only:
            return None
        return model_error_by_held_out_blocks(validation)


def _full_rate_records(identification: Identification) -> list[EquationRecord]:
    """Records of an estimate at the full rate, none of a decimated one."""
    equations = identification.equations
    return [] if equations is None or not equations.full_rate else list(equations.records)


def _splits(
    problem: Problem,
    motion: RepeatedMotion,
    residuals: Sequence[np.ndarray],
    used: Sequence[np.ndarray],
    band: float,
) -> tuple[JointModelError, ...]:
    """The split of each joint, over samples that were used and repeated."""
    rates = [r.rate for r in problem.recordings]
    low = [
        np.ascontiguousarray(butterworth(x.T, rate, band).T)
        for x, rate in zip(residuals, rates, strict=True)
    ]
    noise, total, samples = _squares(motion, low, used)
    noise_all, total_all, _ = _squares(motion, residuals, used)
    units = torque_units(problem)
    return tuple(
        replace(
            _joint(name, units[j], noise[j], total[j], int(samples[j])),
            noise_share_all=float(noise_all[j].sum() / max(total_all[j].sum(), 1e-300)),
        )
        for j, name in enumerate(problem.robot.joint_names)
    )


def _squares(
    motion: RepeatedMotion, residuals: Sequence[np.ndarray], used: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Σ v² and Σ ε² of each joint and block of the motion, and how many samples they have."""
    _, noise, times = motion.split(residuals, used)
    block = np.linspace(0, BLOCKS, motion.count + 1, endpoint=False).astype(int)
    joints = residuals[0].shape[0]
    sums, samples = np.zeros((2, joints, BLOCKS)), np.zeros(joints)
    for residual, v, n, where in zip(residuals, noise, times, motion.instants, strict=True):
        for j in range(joints):
            known = n[j] > 1
            samples[j] += known.sum()
            for k, x in enumerate((v, residual)):
                sums[k, j] += np.bincount(block[where[known]], x[j, known] ** 2, BLOCKS)
    return sums[0], sums[1], samples


def _joint(
    name: str, unit: str, noise: np.ndarray, total: np.ndarray, samples: int
) -> JointModelError:
    """The split of a joint from sums of squares by block, with a jackknife over the blocks.

    ``noise``: Σ v² of each block, shape (blocks,).
    """
    used = total > 0
    noise, total = noise[used], total[used]
    share = float(np.clip(noise.sum() / max(total.sum(), 1e-300), 0.0, 1.0))
    variance = total.sum() / max(samples, 1)
    std = np.nan
    if len(total) > 2:
        without = (noise.sum() - noise) / (total.sum() - total)
        std = float(np.sqrt((len(total) - 1) * np.mean((without - without.mean()) ** 2)))
    return JointModelError(
        name,
        unit,
        float(np.sqrt(variance)),
        float(np.sqrt(share * variance)),
        float(np.sqrt((1.0 - share) * variance)),
        share,
        std,
    )


def _percentages(joint: JointModelError) -> tuple[str, str]:
    """Share of the noise and its interval [%], in matching digits."""
    share = 100.0 * joint.noise_share
    low, high = joint.share_interval
    if not high > low:  # no spread, or all blocks agree: the whole error in each of them
        return format_significant(share, 3 if share == 100.0 else 2), "–"
    value, _ = with_spread(share, 200.0 * joint.share_std)
    decimals = len(value.partition(".")[2])
    return value, f"{100.0 * low:.{decimals}f} to {100.0 * high:.{decimals}f}"


def _share(joint: JointModelError) -> str:
    """Share of the noise with its interval, in words."""
    value, interval = _percentages(joint)
    if interval != "–":
        return f"{value} % (2σ: {interval} %)"
    return f"{value} %" if np.isnan(joint.share_std) else f"{value} % (in every block)"
