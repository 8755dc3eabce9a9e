"""A friction law as lines of an experiment or robot file, to be read in again."""

from __future__ import annotations

from pivident.robot.friction import FrictionColumn, FrictionLaw, FrictionTerm

#: Terms that are implied by an entry's first term.
_FOLLOWERS = (
    FrictionColumn.VISCOUS_NEGATIVE,
    FrictionColumn.COULOMB_NEGATIVE,
    FrictionColumn.SINE,
    FrictionColumn.STRUT_STIFFNESS,
    FrictionColumn.PRESLIDING_RATE,
)

_PLAIN = {
    FrictionColumn.VISCOUS: "viscous",
    FrictionColumn.COULOMB: "coulomb",
    FrictionColumn.OFFSET: "offset",
    FrictionColumn.COULOMB_POSITIVE: "asymmetric",
    FrictionColumn.VISCOUS_POSITIVE: "asymmetric_viscous",
    FrictionColumn.SPRING: "spring",
    FrictionColumn.LOAD: "load",
}


def law_toml(law: FrictionLaw) -> str:
    """The law as a TOML list, ``[{term = "viscous"}, {term = "stribeck", speed = 0.1}]``."""
    entries = [_entry(law, t) for t in law.terms if t.column not in _FOLLOWERS]
    slips = [t.shapes for t in law.terms if t.column is FrictionColumn.MAXWELL]
    if slips:
        distances = ", ".join(_number(shapes[0].value) for shapes in slips)
        rest = [("excess", 1), ("speed", 2), ("exponent", 3)] if len(slips[0]) > 1 else []
        more = "".join(f", {key} = {_number(slips[0][k].value)}" for key, k in rest)
        entries.append(f'{{term = "maxwell_slip", distances = [{distances}]{more}}}')
    return f"[{', '.join(entry for entry in entries if entry)}]"


def _entry(law: FrictionLaw, term: FrictionTerm) -> str:
    """One table of the list; empty for elements of Maxwell slip, which share one."""
    column, values = term.column, [s.value for s in term.shapes]
    sign = ""
    if term.has_sign:
        sign = f', smoothing = "{term.smoothing}"'
        sign += f", gamma = {_number(term.gamma)}" if term.gamma is not None else ""
    if column in _PLAIN:
        return f'{{term = "{_PLAIN[column]}"{sign}}}'
    if column is FrictionColumn.STRIBECK:
        keys = f"speed = {_number(values[0])}, exponent = {_number(values[1])}"
        return f'{{term = "stribeck", {keys}{sign}}}'
    if column is FrictionColumn.POWER:
        name = term.stem.removeprefix("fvx")
        named = f', name = "{name}"' if name else ""
        return f'{{term = "power", exponent = {_number(values[0])}{named}{sign}}}'
    if column is FrictionColumn.COSINE:
        name = term.stem.removeprefix("rc")
        return f'{{term = "ripple", order = {_number(values[0])}, name = "{name}"}}'
    if column is FrictionColumn.STRUT:
        return (
            f'{{term = "counterbalance", ratio = {_number(values[0])}, '
            f"angle = {_number(values[1])}}}"
        )
    if column is FrictionColumn.PRESLIDING and len(values) == 1:
        return f'{{term = "dahl", distance = {_number(values[0])}}}'
    if column is FrictionColumn.PRESLIDING:
        damped = any(t.column is FrictionColumn.PRESLIDING_RATE for t in law.terms)
        names = ("distance", "excess", "speed", "exponent")
        known = ", ".join(f"{k} = {_number(v)}" for k, v in zip(names, values, strict=True))
        return f'{{term = "lugre", {known}, damped = {str(damped).lower()}}}'
    return ""


def _number(x: float) -> str:
    return f"{x:.6g}" if float(f"{x:.6g}") != int(x) else f"{x:.1f}"
