"""Friction laws on the public records: which term gains what, on motion that was not fitted.

    PIVIDENT_DATA=FOLDER python benchmarks/friction_laws.py [emps] [tx40] [kr300]

EMPS: every law is fitted to the estimation file. *Held out*: each eighth of the reference's period
is left out of all periods at once and predicted from the rest; laws are chosen by that. *Unseen*:
the closed loop of the pulses file (5.07 V) simulated with the estimate, force and position. The
best laws once more with drives that answer late; the delay is chosen on the estimation file, too.

TX40: five contiguous folds, 20 Hz, joint by joint, with the 28 essential parameters and offsets;
terms one at a time, then one after the other.

KR300, axes 1 to 3: held-out blocks of both motions below 4 Hz, as in kuka_kr300_blocks.py, and each
motion predicted by the fit to the other one.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from kuka_kr300_blocks import EXAMPLE, START, STOP, held_out, squares, without_vague_inertias

from pivident.data.recording.public_records import (
    load_emps,
    load_emps_pulses,
    load_kuka_kr300,
    load_staubli_tx40,
)
from pivident.data.recording.recording import Recording
from pivident.data.recording.repeated_motion import repeated_motion
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass, RandomWalk
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL
from pivident.foundation.errors import PividentError
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.held_out.prediction import Judge, pooled
from pivident.judgement.validation.held_out.replay import as_logged
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.description import Robot
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    asymmetric_viscous,
    coulomb,
    counterbalance,
    dahl,
    load_dependent,
    lugre,
    maxwell_slip,
    offset,
    power_viscous,
    ripple,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.gallery import load_robot
from pivident.studies.friction_laws.law_choice import with_laws
from pivident.studies.friction_laws.law_scores import has_definite_sign
from pivident.studies.friction_laws.shapes import identify_shapes

#: Parts of the reference's period, each of which is left out once.
PHASES = 8

#: Slope of a sign that is nearly hard on EMPS [s/m]; the example's is 2000.
STEEP = 2e4

#: Lead of the EMPS screw as its ripple shows it [m].
LEAD = 2.5e-3

#: Delays of the drive that are tried [s].
DELAYS = (0.0, 1e-4, 2e-4, 3e-4, 4e-4, 5e-4)

#: Shortest stretch that is fitted [s].
SHORTEST = 0.3

Terms = tuple[FrictionTerm, ...]


@dataclass(frozen=True)
class Candidate:
    """A law to be tried, and which of its constants are identified (None: none of them)."""

    law: FrictionLaw
    constants: tuple[str, ...] | None = None


def _law(*terms: FrictionTerm | Terms) -> FrictionLaw:
    """A law from terms and groups of terms."""
    flat: list[FrictionTerm] = []
    for term in terms:
        flat += [term] if isinstance(term, FrictionTerm) else term
    return FrictionLaw(tuple(flat))


def emps_laws() -> dict[str, Candidate]:
    """Every law that is tried on EMPS; speeds in m/s, distances in m."""
    fc, steep, both = coulomb(gamma=2000.0), coulomb(gamma=STEEP), asymmetric_viscous()
    excess = stribeck(0.0144, gamma=STEEP)
    speed, exponent = ("stribeck_speed",), ("viscous_exponent",)
    screw = 2.0 * np.pi / LEAD
    grid = (3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3)
    return {
        "viscous, Coulomb, offset": Candidate(_law(viscous(), fc, offset())),
        "  slope of the sign free": Candidate(_law(viscous(), fc, offset()), ("gamma",)),
        "  asymmetric Coulomb": Candidate(_law(viscous(), asymmetric_coulomb(gamma=2000.0))),
        "  Stribeck": Candidate(_law(viscous(), steep, offset(), excess), speed),
        "  power of speed": Candidate(_law(power_viscous(0.69), fc, offset()), exponent),
        "  + dq|dq|": Candidate(_law(viscous(), power_viscous(2.0), fc, offset())),
        "  + dq|dq| + dq^3": Candidate(
            _law(viscous(), power_viscous(2.0), power_viscous(3.0, "fvy"), fc, offset())
        ),
        "  ripple of the screw": Candidate(_law(viscous(), fc, offset(), ripple(screw))),
        "  Dahl": Candidate(_law(viscous(), dahl(6e-6), offset()), ("presliding_distance",)),
        "  LuGre": Candidate(
            _law(viscous(), lugre(6e-6, 0.2, 0.0144), offset()),
            ("presliding_distance", "stribeck_excess"),
        ),
        "  Maxwell slip, 6 elements": Candidate(_law(viscous(), maxwell_slip(grid), offset())),
        "asymmetric viscous": Candidate(_law(both, fc, offset())),
        "  slope of the sign free ": Candidate(_law(both, fc, offset()), ("gamma",)),
        "  Stribeck ": Candidate(_law(both, steep, offset(), excess), speed),
        "  Stribeck and slope free": Candidate(
            _law(both, steep, offset(), excess), (*speed, "gamma")
        ),
        "  + power of speed": Candidate(
            _law(both, power_viscous(0.3, gamma=STEEP), steep, offset()), exponent
        ),
        "  + dq|dq| ": Candidate(_law(both, power_viscous(2.0), fc, offset())),
        "  ripple of the screw ": Candidate(_law(both, fc, offset(), ripple(screw))),
        "  Dahl ": Candidate(_law(both, dahl(6e-6), offset()), ("presliding_distance",)),
        "  LuGre ": Candidate(
            _law(both, lugre(6e-6, 0.2, 0.0144), offset()),
            ("presliding_distance", "stribeck_excess"),
        ),
        "  Maxwell slip, 6 elements ": Candidate(_law(both, maxwell_slip(grid), offset())),
        "  Stribeck, Maxwell slip": Candidate(
            _law(both, steep, offset(), excess, maxwell_slip((1e-5, 1e-3))), speed
        ),
    }


def emps(method: str = "iv-full-rate") -> None:
    """One line for each law, without the mask of low speeds, where most of these laws differ."""
    controller = Cascade(kp=[160.18], kv=[243.45], averaged=True)
    loop = Loop(controller, 35.15065188248547, 10.0)
    record, pulses, robot = load_emps(), load_emps_pulses(), load_robot("emps")
    judge = Judge(record)
    print(f"EMPS, {method}: errors below {judge.band:g} Hz, unseen over all")
    print(f"  {'law':28s} par. fitted % held out %  unseen force %, position um  constants")
    tables = {0.0: emps_laws()}
    late = ("asymmetric viscous", "  Stribeck ", "  Stribeck, Maxwell slip")
    tables |= {delay: {name: emps_laws()[name] for name in late} for delay in DELAYS[1:]}
    for delay, laws in tables.items():
        print(f"  drive delay {1e3 * delay:g} ms")
        told_late, judged = replace(record, drive_delay=delay), judge
        if delay:
            judged = Judge(told_late)
        for label, tried in laws.items():
            problem = Problem(robot.with_friction(tried.law), (told_late,), loop, mask=None)
            try:
                problem, found, told = _fitted(problem, method, tried.constants)
                fitted = judged.score(found, [slice(0, record.samples)])[0].total_in_band
                out = _phases(problem, method, tried.constants, judged)
                force, position = unseen(problem, found, replace(pulses, drive_delay=delay))
                told += clipped(found)
            except PividentError as error:
                print(f"  {label:28s} {str(error)[:110]}")
                continue
            print(
                f"  {label:28s} {len(found.theta):4d} {fitted:8.2f} {out:10.2f} {force:14.2f} "
                f"{position:14.2f}  {told}",
                flush=True,
            )


def _fitted(
    problem: Problem, method: str, constants: tuple[str, ...] | None, grid: bool = True
) -> tuple[Problem, Identification, str]:
    """Estimate a law; with its constants, where there are any to identify."""
    if constants is None:
        return problem, identify(problem, method), ""
    names = {problem.robot.joint_names[0]: constants}
    found = identify_shapes(problem, method, names, grid=grid, profiles=False)
    told = ", ".join(f"{s.constant.name} {s.value:.3g} ± {2 * s.std:.1g}" for s in found.shapes)
    return found.problem, found.identification, told


def _phases(
    problem: Problem, method: str, constants: tuple[str, ...] | None, judge: Judge
) -> float:
    """Error on parts of the period that were left out of all periods [%]."""
    record = problem.recordings[0]
    instants = repeated_motion([record]).instants[0]
    borders = np.linspace(0, instants.max() + 1, PHASES + 1).round().astype(int)
    scores = []
    for low, high in pairwise(borders):
        inside = (instants >= low) & (instants < high)
        pieces = _stretches(record, ~inside)
        rest = replace(problem, recordings=tuple(record.part(a, b) for a, b in pieces))
        _, found, _ = _fitted(rest, method, constants, grid=False)
        scores += judge.score(found, [slice(a, b) for a, b in _stretches(record, inside)])
    return pooled(scores).total_in_band


def _stretches(record: Recording, wanted: np.ndarray) -> list[tuple[int, int]]:
    """Contiguous stretches (start, stop) that are long enough to be used."""
    edges = np.flatnonzero(np.diff(np.r_[0, wanted.astype(int), 0]))
    found = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(a, b) for a, b in found if b - a >= SHORTEST * record.rate]


def clipped(found: Identification) -> str:
    """Levels below zero, which the simulation takes as zero: the unseen error is of another law."""
    levels = zip(found.names, found.theta, strict=True)
    return "".join(f" {n} {v:.2g} N simulated as 0" for n, v in levels if n[:2] == "fm" and v < 0)


def unseen(problem: Problem, found: Identification, record: Recording) -> tuple[float, float]:
    """Force error [%] and rms position error [µm] of the loop simulated on another record."""
    other = replace(problem, recordings=(record,))
    (motion,) = AuxiliaryModel(other, differences=False).simulate(found.theta)
    force = np.linalg.norm(as_logged(motion.tau.T, record) - record.tau)
    force /= np.linalg.norm(record.tau)
    return 100 * float(force), 1e6 * float(np.sqrt(np.mean((motion.q.T - record.q) ** 2)))


#: Terms of one joint by the names of joints.
Added = Mapping[str, Terms]


def tx40(method: str = "ls", judged: str = "piv") -> None:
    """Terms on all joints, then one after the other; the last law once more with PIV."""
    robot, record = load_robot("staubli_tx40"), load_staubli_tx40().slice(0.05, 7.5)
    loop = Loop(virtual_pd(robot, record.q.mean(axis=0)), reference="smoothed")
    names = robot.joint_names
    curved, load = (power_viscous(2.0, free=False),), (load_dependent(),)
    single: dict[str, Added] = {
        "viscous, Coulomb, offset": {},
        "dq|dq|, all joints": dict.fromkeys(names, curved),
        "dq^1.5, all joints": dict.fromkeys(names, (power_viscous(1.5, free=False),)),
        "dq^0.5, all joints": dict.fromkeys(names, (power_viscous(0.5, free=False),)),
        "Stribeck, 0.1 of rated speed": {
            j.name: (stribeck(0.1 * (j.rated_speed or 1.0)),) for j in robot.joints
        },
        "load, all joints": dict.fromkeys(names, load),
        "spring, all joints": dict.fromkeys(names, (spring(),)),
        "ripple 30.75 on joint 4": {names[3]: ripple(30.75, "a")},
        "ripple 135 = 3 motor turns on joint 5": {names[4]: ripple(135.0, "a")},
    }
    steps: dict[str, Added] = {
        "dq^1.5 on joint 1": {names[0]: (power_viscous(1.5, free=False),)},
        "+ on joint 2": {names[1]: (power_viscous(1.5, free=False),)},
        "+ on joint 3": {names[2]: (power_viscous(1.5, free=False),)},
        "+ on joint 4": {names[3]: (power_viscous(1.5, free=False),)},
        "+ load on joint 3": {names[2]: load},
        "+ ripple 30.75 on joint 4": {names[3]: ripple(30.75, "a")},
        "+ spring on joint 4": {names[3]: (spring(),)},
    }
    print("TX40: held-out torque error of five folds below 20 Hz [%], total and joints 1 to 6")
    base = None
    law: dict[str, Terms] = {}
    for label, terms in single.items():
        base = _tx40_row(label, robot, record, loop, terms, method, base)
    for label, terms in steps.items():
        for name, own in terms.items():
            law[name] = (*law.get(name, ()), *own)
        base = _tx40_row(label, robot, record, loop, law, method, base)
    plain = _tx40_row(f"{judged}: plain", robot, record, loop, {}, judged, None)
    _tx40_row(f"{judged}: last law", robot, record, loop, law, judged, plain)


def _tx40_row(
    label: str,
    robot: Robot,
    record: Recording,
    loop: Loop,
    added: Added,
    method: str,
    base: np.ndarray | None,
) -> np.ndarray:
    """Print one line; returns total and joints of the first line [%]."""
    shaped, fresh = _with_terms(robot, added)
    chosen = (*TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)), *fresh)
    problem = Problem(shaped, (record,), None if method == "ls" else loop, chosen)
    return _row(label, _tx40_errors(problem, method), base)


def _tx40_errors(problem: Problem, method: str) -> np.ndarray:
    error = cross_validate(problem, method).prediction
    return np.r_[error.total_in_band, error.relative_in_band]


def _with_terms(robot: Robot, added: Added) -> tuple[Robot, tuple[str, ...]]:
    """The robot with further terms, and the names of their parameters."""
    laws, fresh = {}, []
    for name, terms in added.items():
        number = robot.joint_names.index(name) + 1
        own = robot.joints[number - 1].friction
        laws[name] = FrictionLaw((*own.terms, *terms))
        fresh += [f"{term.stem}{number}" for term in terms]
    return (robot.with_friction(laws) if laws else robot), tuple(fresh)


def _row(label: str, values: np.ndarray, base: np.ndarray | None) -> np.ndarray:
    """Print values and their change against the first row, which is returned."""
    base = values if base is None else base
    change = "  ".join(
        f"{v:6.2f} ({100 * (v / b - 1):+5.1f})" for v, b in zip(values, base, strict=True)
    )
    print(f"  {label:44s} {change}", flush=True)
    return base


def kr300() -> None:
    """Laws of axes 1 to 3, least squares: blocks of both motions, and each motion by the other."""
    robot = load_robot(EXAMPLE / "kuka_kr300_axes_1_3.toml")
    method = LeastSquares(signals=Bandpass(cutoff=50.0, bandwidth=20.0))
    runs = tuple(load_kuka_kr300(motion, robot=robot) for motion in ("A", "B"))
    motions = [estimate_kinematics(run, RandomWalk()) for run in runs]
    fewer = without_vague_inertias(robot, runs)
    plain = Problem(robot, tuple(run.slice(START, STOP) for run in runs), None, fewer)
    one, two, three = robot.joint_names
    dry, load = (coulomb(gamma=200.0), offset()), load_dependent(gamma=200.0)
    root = {one: _law(power_viscous(0.655), dry)}
    slopes = {two: _law(asymmetric_viscous(), dry)}
    heavy = {three: _law(viscous(), dry, load)}
    tried: dict[str, dict[str, FrictionLaw]] = {
        "viscous, Coulomb, offset": {},
        "power 0.655 for viscous on 1": root,
        "two viscous slopes on 2": slopes,
        "load on 3": heavy,
        "power on 1, slopes on 2": root | slopes,
        "power on 1, slopes on 2, load on 3": root | slopes | heavy,
        "spring, dq|dq| on 1, Stribeck, slopes on 2, load on 3": heavy
        | {
            one: _law(viscous(), dry, spring(), power_viscous(2.0, free=False)),
            two: _law(asymmetric_viscous(), dry, stribeck(0.05, gamma=200.0)),
        },
        "counterbalance on 2": {two: _law(viscous(), dry, counterbalance(0.4, 2.09)[:1])},
    }
    print("KR300: torque error of axes 1 to 3 below 4 Hz [%], least squares")
    print("  held-out blocks of both motions; A, judged on B; B, judged on A; impossible signs")
    for label, laws in tried.items():
        problem = with_laws(plain, laws) if laws else plain
        blocks = held_out(problem.robot, runs, None, method, lambda r, f, p=problem: p.parameters)
        rows = [blocks]
        for number, run in enumerate(problem.recordings):
            found = identify(replace(problem, recordings=(run,)), method)
            error, torque = squares(found, motions[1 - number], START, STOP)
            rows.append(100 * np.sqrt(error / torque))
        listed = "   ".join(" ".join(f"{x:5.2f}" for x in own) for own in rows)
        whole = identify(problem, method)
        wrong = [
            f"{p.name} {value:.0f} ± {2 * std:.0f}"
            for p, value, std in zip(whole.parameters, whole.theta, whole.robust_std, strict=True)
            if p.friction and has_definite_sign(p.friction) and value < 0.0
        ]
        print(f"  {label:54s} {blocks.mean():.2f}  {listed}  {', '.join(wrong)}", flush=True)


def main() -> None:
    parts = {"emps": emps, "tx40": tx40, "kr300": kr300}
    for name in sys.argv[1:] or list(parts):
        parts[name]()


if __name__ == "__main__":
    main()
