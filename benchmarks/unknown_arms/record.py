"""A record: the logs of one machine along its motions, its files, and the truth beside them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from . import motion as motions
from .logs import control_rate, data_sheet, logged_ticks, write_log, write_robot
from .simulator import Trace, simulate
from .truth import Machine, machine, true_base_parameters

#: Length of a run [s] by arm; period [s] and number of periods of the motion that repeats.
SECONDS = {"cobot6": 24.0, "link7": 20.0, "scara": 12.0}
PERIODS = {"cobot6": (5.0, 5), "link7": (4.0, 5), "scara": (2.0, 6)}

#: The runs of a record. The user never identifies from the last one.
RUNS = ("sines", "moves", "repeated", "held_out")


def make_motion(made: Machine, run: str) -> motions.Motion:
    """The reference of a run."""
    arm, rate = made.arm, control_rate(made)
    rng = np.random.default_rng([made.seed, 5, RUNS.index(run)])
    seconds = SECONDS[arm.name]
    if run == "repeated":
        return motions.repeated(arm, rng, rate, *PERIODS[arm.name])
    if run == "moves":
        return motions.moves(run, arm, rng, rate, seconds)
    return motions.sum_of_sines(run, arm, rng, rate, seconds)


def write_record(
    folder: Path,
    name: str,
    seed: int,
    runs: Sequence[str] = RUNS,
    *,
    references: str = "speed",
    exact_sheet: bool = False,
    noise: float = 1.0,
) -> Machine:
    """Write logs, robot, data sheet and truth of one machine.

    Args:
        folder: where; it is made.
        name: of the arm.
        seed: decides the machine, its motions, its law and its noise.
        runs: which of `RUNS`.
        references: what of the reference is logged, see `logs.write_log`.
        exact_sheet: whether the data sheet's torque constants are the true ones.
        noise: factor of the encoders' noise.

    Returns:
        The machine.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = machine(name, seed, exact_sheet)
    write_robot(folder, made)
    law = ""
    gains: dict[str, list[float]] = {}
    for run in runs:
        trace = simulate(made, make_motion(made, run), noise)
        write_log(folder / f"{run}.csv", made, trace, references)
        write_trace(folder / f"truth_{run}.npz", made, trace)
        law = trace.law.describes
        gains = {key: value.tolist() for key, value in trace.law.gains.items()}
    truth = {
        "arm": name,
        "seed": seed,
        "base_parameters": true_base_parameters(made, users_robot(folder, made)),
        "machine": _described(made),
        "law": law,
        "gains": gains,
        "encoder_noise": [noise * x for x in made.arm.encoder_noise],
        "torque_noise": list(made.arm.torque_noise),
        "period_s": PERIODS[name][0],
        "period_begins_s": motions.REST + motions.FADE,
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")
    return made


def users_robot(folder: Path, made: Machine):
    """The robot as a user describes it: the URDF, and the shafts of the data sheet."""
    import dataclasses

    from pivident.robot.description import Coupling
    from pivident.robot.urdf import read_urdf

    robot = read_urdf(folder / f"{made.arm.name}.urdf")
    couplings = tuple(Coupling(s.motor, s.joint, s.ratio) for s in made.arm.shafts)
    return dataclasses.replace(robot, couplings=couplings)


def write_trace(path: Path, made: Machine, trace: Trace) -> None:
    """What truly happened at the logged ticks, without noise."""
    rng = np.random.default_rng([made.seed, 4, *trace.motion.name.encode()])
    rows = logged_ticks(made, len(trace.q), rng)
    np.savez_compressed(
        path,
        t=rows / trace.motion.rate,
        q=trace.q[rows],
        dq=trace.dq[rows],
        ddq=trace.ddq[rows],
        tau=trace.tau_link[rows],
        tau_motor=trace.tau[rows],
        q_ref=trace.motion.q[rows],
        dq_ref=trace.motion.dq[rows],
    )


def _described(made: Machine) -> dict:
    """The machine's standard parameters, in the links' URDF frames."""
    links = {
        joint.name: {
            "mass": body.mass,
            "center_of_mass": body.center.tolist(),
            "inertia_at_center_of_mass": body.inertia.tolist(),
        }
        for joint, body in zip(made.arm.joints, made.bodies, strict=True)
    }
    return {
        "links": links,
        "rotor_inertia": made.rotor.tolist(),
        "viscous": made.viscous.tolist(),
        "coulomb": made.coulomb.tolist(),
        "share_of_friction_behind_the_sensor": made.arm.bearing_share,
        "offset": made.offset.tolist(),
        "shafts": [s.__dict__ for s in made.shafts],
        "gain": made.gain.tolist(),
        "sheet_gain": made.sheet_gain.tolist(),
        "data_sheet": data_sheet(made),
    }
