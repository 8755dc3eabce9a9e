"""What the verdict says about the residual: noise, lines of the encoders, model error."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.method import AutoRegressive
from pivident.foundation.text.finding import Finding, Severity
from pivident.foundation.text.numbers import format_significant
from pivident.foundation.text.sentences import listed
from pivident.judgement.diagnostics.diagnostics import Diagnostics
from pivident.judgement.validation.residuals.residual_tests import (
    ResidualTests,
    simulation_whiteness,
)


def noise(result: Identification, tests: ResidualTests) -> Iterator[Finding]:
    """Whether the noise model whitens, and what else the residual shows."""
    yield from _simulation_noise(result)
    whiteness = tests.of("whiteness")
    worst = tests.worst("whiteness")
    if worst is None:
        return
    coloured = tuple(joint for joint, test in whiteness if test.matters)
    modelled = any(j.ar_order for j in result.joints)
    residual = "residual"
    if result.simulation is not None:  # of equations that the fit did not solve
        residual = "torque residual on the measured motion"
    what = f"The noise model whitens the {residual}" if modelled else f"The {residual} is white"
    basis = f"{worst[0]}: {worst[1]}"
    robust = bool(np.isfinite(result.robust_std).all())
    if not coloured:
        yield Finding("ok", "noise", "white", f"{what} on all joints.", basis=basis)
    else:
        rest = (
            "the fit does not use it"
            if result.simulation is not None
            else "the standard errors account for that"
            if robust
            else "the standard errors do not account for that"
        )
        if modelled and _continues_level(result):
            rest += (
                ". It leaves the motion's own frequencies alone, where the residual may be mostly "
                "model error"
            )
        what = f"The {residual} is coloured"
        if modelled:
            what = f"The noise model does not whiten the {residual}"
        text = f"{what} on {listed(coloured)}; {rest}."
        severity: Severity = "note" if robust else "warning"
        yield Finding(severity, "noise", "coloured", text, basis=basis)
    for topic, sentence in (
        ("variance", "The {residual}'s variance changes with the motion on {joints}"),
        ("motion", "The motion explains part of the {residual} on {joints}"),
    ):
        matter = tuple(joint for joint, test in tests.of(topic) if test.matters)
        most = tests.worst(topic)
        if matter and most is not None:
            whose = residual.removesuffix(" on the measured motion")
            text = sentence.format(joints=listed(matter), residual=whose) + "."
            basis = f"{most[0]}: {most[1]}"
            yield Finding("note", "noise", topic, text, basis=basis)


def _simulation_noise(result: Identification) -> Iterator[Finding]:
    """Whether noise models whiten the errors of a fitted simulation."""
    if result.simulation is None or not result.simulation.noise_orders:
        return
    tests = simulation_whiteness(result)
    coloured = [t for t in tests if t.test.matters]
    if not tests:
        return
    worst = min(tests, key=lambda t: (not t.test.matters, t.test.robust_p_value))
    basis = f"{worst.what} of {worst.joint}: {worst.test}"
    if not coloured:
        text = "The noise models whiten the simulation errors on all joints."
        yield Finding("ok", "simulation", "white", text, basis=basis)
        return
    names = [f"{t.joint} ({t.what})" for t in coloured]
    robust = bool(np.isfinite(result.robust_std).all())
    rest = (
        "the standard errors are tested against windows of time, which account for that"
        if robust
        else "the standard errors by the formula do not account for that"
    )
    text = f"The noise models do not whiten the simulation errors of {listed(names)}; {rest}."
    yield Finding("note" if robust else "warning", "simulation", "coloured", text, basis=basis)


def _continues_level(result: Identification) -> bool:
    """Whether the noise level beyond the motion's band was continued into it."""
    equations = result.equations
    method = result.method_used
    if equations is None or method is None or not isinstance(method.noise, AutoRegressive):
        return False
    return method.noise.motion_band is not None


def spectral_lines(result: Identification) -> Iterator[Finding]:
    """Spectral lines of the encoders, which the smoother has taken into account."""
    records = () if result.equations is None else result.equations.records
    units = {joint.name: joint.position_unit for joint in result.robot.joints}
    found = {
        f"{joint} at {format_significant(line.frequency)} Hz, {format_significant(line.std, 2)} "
        f"{units[joint]}"
        for r in records
        for joint, lines in zip(units, r.kinematics.lines, strict=False)
        for line in lines
    }
    if found:
        text = "The encoders' noise has spectral lines, which the smoother has taken into account"
        yield Finding("note", "encoders", "spectral lines", f"{text}: {listed(sorted(found))}.")


def friction_law(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """What the intervals of friction parameters assume; whether it is wrong, causes say.

    A covariance knows the noise. It does not know that another law of friction would give these
    parameters other values, whatever kind of covariance it is.
    """
    result = diagnostics.identifications[name]
    own = [
        (own_name, p.joint)
        for own_name, p in zip(result.names, result.parameters, strict=True)
        if p.friction is not None or p.stem in ("fvm", "fcm")
    ]
    if not own:
        return
    laws = dict.fromkeys(str(result.robot.tree.joints[j].friction) for _, j in own)
    yield Finding(
        "note",
        "friction",
        "assumed law",
        f"The intervals of {listed([own_name for own_name, _ in own])} hold for the assumed "
        f"friction law only: {listed(list(laws))}.",
    )


def model_or_noise(diagnostics: Diagnostics) -> Iterator[Finding]:
    """Whether the residual is model error or noise."""
    split = diagnostics.model_error
    if split is None:
        return
    severity: Severity = "note" if split.mostly_model_error else "ok"
    kind = "model error" if split.mostly_model_error else "noise"
    yield Finding(severity, "residual", kind, " ".join(split.sentences()))
