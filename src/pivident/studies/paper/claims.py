"""What the paper claims in sections 5 and 6, in our words, and what the repetition says of it.

A claim is judged for every reading of the encoders. It *holds* if it does for all, *holds with a
condition* if it does for some, which are named, and is *not reproduced* if it does for none: that
is what a twin can say of a claim about an arm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from pivident.foundation.text.numbers import plus_minus
from pivident.studies.many.study.summary import NOMINAL_COVERAGE, geometric_mean
from pivident.studies.paper.experiment import FORMS, IDENTIFIED, READINGS, Reading
from pivident.studies.paper.published import published_table, stated
from pivident.studies.paper.repetition import Repetition, Runs, ratio_of_deviations

LS, IV, PRINTED, PIV = (FORMS[name] for name in ("ls", "iv", "piv-as-printed", "piv"))

#: Pairs of viscous and dry friction of one joint or motor.
FRICTION = tuple((f"fv{j}", f"fc{j}") for j in ("1", "2", "3", "4", "5", "6", "m6"))

#: Intervals that cover less than this share are wrong; errors this many times larger are worse.
FEW_COVERED, CLEARLY = 0.85, 2.0

#: Share of runs that have to converge for a method to count as one that does.
MOST = 0.95

#: Autocorrelations of white noise beyond ±2/√n, and what still counts as so few.
BEYOND, FEW_BEYOND = 0.05, 0.10

#: Error on other motion by which PIV may exceed IV and still fit as well.
AS_WELL = 1.02

#: A control law that leaves this share of its output unexplained (rms) is found.
FOUND = 0.01

#: Orders this near to the largest one allowed are at the bound.
LARGEST_ORDER = 150

#: Frequency beyond which no motion of these arms lies: what a smoother keeps above is noise [Hz].
MOTION_ENDS = 100.0


@dataclass(frozen=True)
class Judged:
    """A claim in one reading: whether it holds, and the numbers."""

    holds: bool | None  # None: nothing to judge it by
    numbers: str


@dataclass(frozen=True)
class Claim:
    """One claim with its verdict."""

    section: str
    says: str  # in our words
    judged: Mapping[str, Judged]  # by reading

    @property
    def verdict(self) -> str:
        """Holds, holds with a condition (which readings), or not reproduced."""
        known = {name: own.holds for name, own in self.judged.items() if own.holds is not None}
        if not known:
            return "not judged"
        good = [name for name, holds in known.items() if holds]
        if len(good) == len(known):
            return "holds"
        if not good:
            return "not reproduced"
        return f"holds with a condition: reading {' and '.join(good)}"


def claims(readings: Mapping[str, Reading], repetition: Repetition) -> tuple[Claim, ...]:
    """All claims, judged.

    Args:
        readings: one experiment of each reading.
        repetition: the experiment repeated.
    """
    table, said = published_table(), stated()
    ls = {row.name: 100.0 * (row.value["ls"] / row.value["piv"] - 1.0) for row in table}
    ratios = np.array([row.relative_std["piv"] / row.relative_std["iv"] for row in table])
    fell, mean = int(np.sum(ratios < 1.0)), geometric_mean(ratios)
    rows: list[tuple[str, str, Callable[[Reading, Mapping[str, Runs]], Judged]]] = [
        ("5.1", f"The motion excites all {len(table)} parameters.", _excited),
        ("5.1", "The AIC selects noise models of very high order.", _high_orders),
        (
            "5.2",
            "IDIM-LS is not satisfactory: it misses the inertias (in Table 1 zz1r by "
            f"{ls['zz1r']:+.0f} %, zz3r by {ls['zz3r']:+.0f} % of IDIM-PIV).",
            _inertias_biased,
        ),
        (
            "5.2",
            "IDIM-LS takes dry friction for viscous friction (in Table 1 fv1 by "
            f"{ls['fv1']:+.0f} %, fc1 by {ls['fc1']:+.0f} % of IDIM-PIV).",
            _friction_biased,
        ),
        (
            "5.2",
            f"IDIM-IV and IDIM-PIV converge, in {said['iterations_iv']} and "
            f"{said['iterations_piv']} iterations.",
            _converge,
        ),
        ("5.2", "Torques of another motion fit as well by IDIM-PIV as by IDIM-IV.", _fit_as_well),
        (
            "5.2",
            f"Relative standard deviations fall from IDIM-IV to IDIM-PIV, in Table 1 for {fell} of "
            f"{len(table)} (geometric mean of the ratios {mean:.2f}).",
            _more_precise,
        ),
        ("5.2", "The prefilters make the residuals white, unlike those of IDIM-IV.", _white),
        ("5.2", "The standard deviations of IDIM-PIV are the more reliable ones.", _reliable),
        ("5.3", "SRIV identifies the control laws.", _law_found),
        (
            "5.3",
            "With the identified law IDIM-PIV gives the same estimates.",
            partial(_same_with_law, PIV),
        ),
        ("6", "IDIM-PIV needs no prior knowledge: it works as it is.", _works),
        ("6", "IRW smoothing builds the observation matrix by itself.", _smooths),
        ("6", "The identified law serves IDIM-IV, too.", partial(_same_with_law, IV)),
    ]
    return tuple(
        Claim(
            section,
            says,
            {
                name: judge(readings[name], repetition.readings.get(name, {}))
                for name in READINGS
                if name in readings
            },
        )
        for section, says, judge in rows
    )


def percent(share: float) -> str:
    """A share in percent with two digits, more from ten percent on; a dash for NaN."""
    if np.isnan(share):
        return "–"
    value = 100.0 * share
    return f"{value:.1f} %" if abs(value) >= 10.0 else f"{value:.2g} %"


def _unknown() -> Judged:
    return Judged(None, "no estimates")


def _has(forms: Mapping[str, Runs], *names: str) -> bool:
    return all(name in forms and len(forms[name].theta) > 1 for name in names)


def _excited(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    """Every standard error is below a third of its parameter, by the best form."""
    if not _has(forms, LS, PIV):
        return _unknown()
    relative = forms[PIV].relative_std
    worst = int(np.argmax(relative))
    return Judged(
        bool(relative[worst] < 1.0 / 3.0),
        f"largest relative standard error of {PIV} {percent(relative[worst])} "
        f"({forms[PIV].names[worst]}), median {percent(float(np.median(relative)))}",
    )


def _high_orders(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    if not _has(forms, PIV):
        return _unknown()
    own = forms[PRINTED] if _has(forms, PRINTED) else forms[PIV]
    low, middle, high = np.percentile(own.orders, [5, 50, 95])
    return Judged(
        bool(middle > 0.5 * LARGEST_ORDER),
        f"median order {middle:.0f}, 90 % between {low:.0f} and {high:.0f}; the largest allowed is "
        f"{LARGEST_ORDER}",
    )


def _inertias_biased(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    """Both inertias lie outside their intervals more often than they may, and PIV's are better."""
    if not _has(forms, LS, PIV):
        return _unknown()
    own, parts, wrong = forms[LS], [], []
    for name in ("zz1r", "zz3r"):
        k = own.names.index(name)
        error, better = (float(np.median(np.abs(f.theta[:, k] / f.truth[k] - 1.0)))
                         for f in (own, forms[PIV]))  # fmt: skip
        covered = float(own.covered[:, k].mean())
        wrong.append(covered < FEW_COVERED and error > CLEARLY * better)
        parts.append(
            f"{name}: bias {_bias(*own.relative_bias(name))}, median error {percent(error)} "
            f"({PIV} {percent(better)}), covered {percent(covered)}"
        )
    return Judged(all(wrong), "; ".join(parts))


def _friction_biased(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    """Viscous friction is too large and dry friction too small, beyond their intervals."""
    if not _has(forms, LS):
        return _unknown()
    own = forms[LS]
    pairs = [(own.relative_bias(fv), own.relative_bias(fc)) for fv, fc in FRICTION]
    traded = [fv[0] > fv[1] and -fc[0] > fc[1] for fv, fc in pairs]
    fv, fc = pairs[0]
    return Judged(
        2 * sum(traded) > len(traded),
        f"{sum(traded)} of {len(traded)} pairs beyond their intervals; fv1 {_bias(*fv)}, "
        f"fc1 {_bias(*fc)}",
    )


def _converge(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    """IV and the printed form do, in the paper's iterations; the recommended one is named too."""
    most = {IV: stated()["iterations_iv"], PRINTED: stated()["iterations_piv"]}
    if not most.keys() <= forms.keys():
        return _unknown()
    parts, good = [], []
    for name in (*most, PIV):
        own, steps = forms[name], np.inf
        low, high = own.converged_interval
        text = f"{name} converges on {percent(own.converged_share)} of the records"
        text += f" ({percent(low)} to {percent(high)})"
        if len(own.theta):
            steps = float(np.median(own.iterations))
            text += f", median {steps:.0f} iterations"
        if name in most:
            good.append(own.converged_share >= MOST and steps <= most[name])
        parts.append(text)
    return Judged(all(good), "; ".join(parts))


def _fit_as_well(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    made = reading.predictions
    if IV not in made or (PRINTED not in made and PIV not in made):
        return _unknown()
    errors = {}
    for name in (IV, PRINTED, PIV):
        if name in made and (error := made[name].error) is not None:
            errors[name] = error.errors.total
    best = min(error for name, error in errors.items() if name != IV)
    return Judged(
        best <= AS_WELL * errors[IV],
        ", ".join(f"{name} {error:.2f} %" for name, error in errors.items())
        + " of the torque on the second motion",
    )


def _more_precise(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    parts, good = [], []
    for name in (PRINTED, PIV):
        if not _has(forms, name, IV):
            continue
        ratios, mean = ratio_of_deviations(forms[name], forms[IV])
        fewer = int(np.sum(ratios < 1.0))
        good.append(2 * fewer > ratios.size and mean < 1.0)
        parts.append(f"{name}: {fewer} of {ratios.size} fall, geometric mean {mean:.2g}")
    missing = _without_estimate(forms)
    return Judged(good[0] and not missing, "; ".join(missing + parts)) if good else _unknown()


def _without_estimate(forms: Mapping[str, Runs]) -> list[str]:
    """That the printed form, of which a claim speaks, gives hardly an estimate; else nothing."""
    if PRINTED not in forms or _has(forms, PRINTED):
        return []
    return [f"{PRINTED} gives no estimate on {forms[PRINTED].failed} of {forms[PRINTED].count}"]


def _white(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    shares = {
        name: float(forms[name].correlated.mean())
        for name in (IV, PRINTED, PIV)
        if _has(forms, name)
    }
    if IV not in shares or len(shares) < 2:
        return _unknown()
    prefiltered = next(iter(list(shares)[1:]))
    text = ", ".join(f"{name} {percent(share)}" for name, share in shares.items())
    return Judged(
        shares[prefiltered] < FEW_BEYOND < shares[IV],
        f"beyond ±2/√n lie {text} of the autocorrelations; of white noise {percent(BEYOND)}",
    )


def _reliable(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    present = [name for name in (IV, PRINTED, PIV) if _has(forms, name)]
    if IV not in present or len(present) < 2:
        return _unknown()
    off = {name: abs(forms[name].coverage - NOMINAL_COVERAGE) for name in present}
    text = ", ".join([*(_coverage(n, forms[n]) for n in present), *_without_estimate(forms)])
    return Judged(
        off[present[1]] < off[IV] and not _without_estimate(forms),
        f"the truth lies within ±2σ: {text}; {percent(NOMINAL_COVERAGE)} is right",
    )


def _coverage(name: str, own: Runs) -> str:
    low, high = own.coverage_interval
    between = "" if np.isnan(low) else f" ({percent(low)} to {percent(high)})"
    return f"{name} {percent(own.coverage)}{between}"


def _law_found(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    if reading.law is None:
        return _unknown()
    left = max(reading.law.relative_error)
    orders = sorted({len(e.denominators[0]) - 1 for e in reading.law.estimates})
    return Judged(
        left < FOUND,
        f"at most {percent(left)} of the output (rms) unexplained, denominators of order "
        f"{' and '.join(map(str, orders))}",
    )


def _same_with_law(form: str, reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    """Estimates with known and identified law differ by less than a standard error."""
    known, other = (reading.results.get(form + behind) for behind in ("", IDENTIFIED))
    if known is None or other is None:
        return _unknown()
    apart = float(np.max(np.abs(other.theta - known.theta) / known.method_std))
    return Judged(apart < 1.0, f"{form}: known and identified law differ by at most {apart:.2g} σ")


def _works(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    if PRINTED not in forms:
        return _unknown()
    shares = {name: forms[name].converged_share for name in (PRINTED, PIV) if name in forms}
    text = ", ".join(f"{name} on {percent(share)}" for name, share in shares.items())
    return Judged(shares[PRINTED] >= MOST, f"converges with what it chooses itself: {text}")


def _smooths(reading: Reading, forms: Mapping[str, Runs]) -> Judged:
    f50 = reading.smoothed_as_printed
    return Judged(
        bool(f50.max() < MOTION_ENDS),
        f"the smoother as printed keeps what lies below {f50.min():.0f} to {f50.max():.0f} Hz "
        "(half power, by joint)",
    )


def _bias(mean: float, half: float) -> str:
    """Bias with its 95 % interval."""
    return f"{plus_minus(100 * mean, 100 * half, sign=True)} %"


#: Kinds of verdicts, and how several claims are said to have them.
KINDS = {
    "holds": "hold",
    "holds with a condition": "hold with a condition",
    "not reproduced": "were not reproduced",
    "not judged": "were not judged",
}


def verdicts(judged: Iterable[Claim]) -> dict[str, int]:
    """How many claims hold, hold with a condition, do not, or were not judged."""
    kinds = [claim.verdict.partition(":")[0] for claim in judged]
    return {kind: kinds.count(kind) for kind in KINDS if kind in kinds}
