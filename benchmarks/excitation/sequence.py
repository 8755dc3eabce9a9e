"""Designs after one another, for chosen parameters, and beside a motion like that of the paper.

    python -m benchmarks.excitation.sequence [--seconds 20] [--parts sequence chosen paper]

``sequence``: two records of 10 s of a simulated arm whose frictions and masses differ from the
description by 20 to 50 %, the second designed after the result of the first, against one record of
20 s. ``chosen``: a design for some parameters against the D-optimal one, over these. ``paper``: the
TX40 with its 28 essential parameters, a design against point-to-point moves of the same length at
80 % of the speeds. Printed: the largest standard error over the size of its parameter that matters
(of the 28 over their values), predicted and as PIV reports it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial

import numpy as np

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.experiment.simulated_tx40 import _KD, _KP, _KTAU, TX40_ESSENTIAL
from pivident.loop import virtual_pd
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot
from pivident.studies import Design, DesignRequest, design_motion
from pivident.studies.excitation.design_task import DesignTask
from pivident.studies.excitation.knowledge import knowledge
from pivident.studies.excitation.limits import joint_limits
from pivident.studies.excitation.questions import robot_question

RATE = 1000.0

#: Noise of the encoders [rad] and of the torque sensors [N m] of each robot.
NOISES = {"staubli_tx40": (2e-6, 0.02), "planar_2r": (2e-6, 0.05)}


def loop_of(name: str, robot: Robot) -> pv.Loop:
    if name == "staubli_tx40":
        return pv.Loop(pv.PD(_KP * _KTAU, _KD * _KTAU))
    return pv.Loop(virtual_pd(robot, np.zeros(robot.size)))


def changed(robot: Robot, seed: int) -> dict[str, float]:
    """Values of a machine that differs from its description by 20 to 50 %, up or down."""
    base, rng = base_parameters(robot), np.random.default_rng(seed)
    values = base.values(nominal_values(robot, base.standard))
    shares = 1.0 + rng.choice([-1.0, 1.0], len(base)) * rng.uniform(0.2, 0.5, len(base))
    friction = np.array([bool(p.friction) for p in base.parameters])
    # inertias change together, so that they remain those of a machine
    shares[~friction] = 1.0 + rng.uniform(0.2, 0.5)
    return dict(zip(base.names, (values * shares).tolist(), strict=True))


def record(name: str, robot: Robot, reference, truth, seed: int):
    encoder, torque = NOISES[name]
    return pv.simulate(
        robot, loop_of(name, robot), reference, values=truth, rate=RATE, encoder=encoder,
        torque=torque, seed=seed,
    ).recording  # fmt: skip


def identified(name: str, robot: Robot, recordings, parameters=None) -> pv.Identification:
    problem = pv.Problem(robot, tuple(recordings), loop_of(name, robot), parameters)
    return pv.identify(problem, "piv")


def reference_of(design: Design) -> np.ndarray:
    return design.motion.sampled(RATE)[0]


def relative(result: pv.Identification, sizes: dict[str, float], names=None) -> np.ndarray:
    """Reported standard errors over the sizes that matter."""
    return np.array(
        [
            std / sizes[name]
            for name, std in zip(result.names, result.std, strict=True)
            if names is None or name in names
        ]
    )


def sizes_of(robot: Robot) -> dict[str, float]:
    """What a design takes for the size of each parameter."""
    known = knowledge(robot, joint_limits(robot))
    sizes = np.fmax(np.abs(known.values), known.significant)
    return dict(zip(known.base.names, sizes.tolist(), strict=True))


def sequence(name: str, seconds: float, seeds: int) -> None:
    robot = load_robot(name)
    for seed in range(seeds):
        truth, sizes = changed(robot, seed), sizes_of(robot)
        design = partial(design_motion, robot)
        start = identified(name, robot, [record(name, robot, _looked(robot), truth, 50 + seed)])
        one = design(DesignRequest(20.0, criterion="worst", seconds=seconds), after=[start])
        first = design(DesignRequest(10.0, criterion="worst", seconds=seconds / 2))
        records = [record(name, robot, reference_of(first), truth, 100 + seed)]
        result = identified(name, robot, records)
        request = DesignRequest(10.0, criterion="worst", seconds=seconds / 2)
        second = design(request, after=[result])
        records.append(record(name, robot, reference_of(second), truth, 200 + seed))
        both = relative(identified(name, robot, records), sizes).max()
        blind = design(DesignRequest(20.0, criterion="worst", seconds=seconds))
        whole = {}
        for words, made in (("blind", blind), ("informed", one)):
            single = identified(
                name, robot, [record(name, robot, reference_of(made), truth, 300 + seed)]
            )
            whole[words] = relative(single, sizes).max()
        print(
            f"{name}, machine {seed}: largest relative σ by PIV: "
            f"10 s {_percent(relative(result, sizes).max())}, "
            f"10 s + 10 s after it {_percent(both)}, one of 20 s {_percent(whole['blind'])}, "
            f"one of 20 s after an ordinary record {_percent(whole['informed'])}",
            flush=True,
        )


def _looked(robot: Robot) -> np.ndarray:
    """An ordinary record: moves between random postures."""
    limits = joint_limits(robot)
    rng = np.random.default_rng(4)
    postures = limits.middle + rng.uniform(-0.6, 0.6, (14, robot.size)) * limits.half
    return point_to_point(postures, 0.8 * limits.speed, RATE, int(10 * RATE))[0]


def chosen(name: str, parameters: tuple[str, ...], seconds: float) -> None:
    robot = load_robot(name)
    sizes, found = sizes_of(robot), {}
    for words, request in (
        ("D-optimal for all", DesignRequest(criterion="d", seconds=seconds)),
        ("for these", DesignRequest(parameters=parameters, seconds=seconds)),
    ):
        made = design_motion(robot, request)
        own = {p.name: p.std for p in made.predicted}
        found[words] = {n: own[n] / sizes[n] for n in parameters}
        listed = ", ".join(f"{n} {_percent(x)}" for n, x in found[words].items())
        print(f"{name}, {words}: {listed}", flush=True)
    first, second = (max(own.values()) for own in found.values())
    print(f"{name}: largest over these {_percent(first)} -> {_percent(second)}")


def paper(seconds: float, duration: float) -> None:
    """The 28 of the paper, by a design and by point-to-point moves of the same length."""
    name = "staubli_tx40"
    robot = load_robot(name)
    base = base_parameters(robot)
    essential = [base.names[base.index(n)] for n in TX40_ESSENTIAL]
    rng = np.random.default_rng(40)
    reach = np.array([2.0, 1.2, 1.2, 2.4, 1.2, 2.4])
    samples = int(duration * RATE)
    postures = rng.uniform(-reach, reach, (12 + int(2 * duration), robot.size))
    moves = point_to_point(postures, 0.8 * robot.rated_speeds, RATE, samples)[0]
    truth = dict(
        zip(base.names, base.values(nominal_values(robot, base.standard)).tolist(), strict=True)
    )
    designs = {"moves": moves}
    request = DesignRequest(duration, parameters=tuple(essential), seconds=seconds)
    first = identified(name, robot, [record(name, robot, moves, truth, 1)])
    design = design_motion(robot, request)
    designs["design"] = reference_of(design)
    task = _task(robot, request, first)
    for words, reference in designs.items():
        dq = np.gradient(reference, 1.0 / RATE, axis=0)
        ddq = np.gradient(dq, 1.0 / RATE, axis=0)
        information = task.information(RATE).of((reference, dq, ddq))
        own = np.array([base.index(n) for n in essential])
        all_std = np.sqrt(np.diag(np.linalg.inv(information)))[own]
        alone = np.sqrt(np.diag(np.linalg.inv(information[np.ix_(own, own)])))
        sizes = np.array([abs(truth[n]) for n in essential])
        result = identified(name, robot, [record(name, robot, reference, truth, 7)])
        known = {n: abs(v) for n, v in truth.items()}
        reached = relative(result, known, essential)
        problem = pv.Problem(
            robot,
            (record(name, robot, reference, only(truth, essential), 8),),
            loop_of(name, robot),
            tuple(TX40_ESSENTIAL),
        )
        few = relative(pv.identify(problem, "piv"), known, essential)
        print(
            f"{words} ({duration:g} s): largest σ/|θ| of the 28, predicted "
            f"{_percent((all_std / sizes).max())} (all {len(base)} estimated), "
            f"{_percent((alone / sizes).max())} (only the 28); by PIV {_percent(reached.max())} "
            f"and {_percent(few.max())}",
            flush=True,
        )


def only(truth: dict[str, float], names) -> dict[str, float]:
    return {n: (v if n in names else 0.0) for n, v in truth.items()}


def _task(robot: Robot, request: DesignRequest, result: pv.Identification) -> DesignTask:
    """What is predicted with the noise of a result, without its information."""
    limits = joint_limits(robot)
    known = knowledge(robot, limits, [result])
    known = replace(known, earlier=np.zeros_like(known.earlier))
    question = robot_question(known.base, known.values)
    return DesignTask(robot, request, limits, known, question, None)


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="of each search")
    parser.add_argument("--seeds", type=int, default=3, help="machines of the sequence")
    parser.add_argument("--parts", nargs="*", default=["sequence", "chosen", "paper"])
    options = parser.parse_args()
    if "sequence" in options.parts:
        for name in ("planar_2r", "staubli_tx40"):
            sequence(name, options.seconds, options.seeds)
    if "chosen" in options.parts:
        chosen("staubli_tx40", ("zz3r", "fc5", "my5r"), options.seconds)
        chosen("planar_2r", ("zz2", "my2"), options.seconds)
    if "paper" in options.parts:
        paper(options.seconds, 20.0)


if __name__ == "__main__":
    main()
