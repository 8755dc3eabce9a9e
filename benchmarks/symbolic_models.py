"""Symbolic models: what they cost, how long they take to make, how fast their C is.

    PIVIDENT_THREADS=1 python benchmarks/symbolic_models.py [ROBOT.urdf ...]

For the robots of the gallery, a seven-axis arm and a SCARA (and robot files that are named):

- multiplications, additions, sines of every model with base parameters, of the inverse model
  without friction and without rotors, and of a step of Newton's method that closes loops; seconds
  of processor time to make all of them;
- largest deviation from the compiled kernels over 1000 random states (with closed loops: along a
  motion), relative to the largest element; of closed loops torque and observation matrix;
- nanoseconds per state of the kernels and of the generated C, one thread against one thread, with
  the same arrays in and out (samples, joints), processor time of the thread, best of 15 turns.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ["PIVIDENT_THREADS"] = "1"

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.forward import mass_matrix as numeric_mass_matrix
from pivident.dynamics.robot_regressor import regressor_of
from pivident.models.symbolic.assignments import closings_of
from pivident.models.symbolic.closed_symbols import closed_symbols
from pivident.models.symbolic.newton_euler import inverse_model
from pivident.models.symbolic.print_c import c_source
from pivident.models.symbolic.program import Program
from pivident.models.symbolic.robot_models import symbolic_models
from pivident.robot.description import Robot
from pivident.robot.gallery import gallery_names, load_robot
from pivident.robot.modified_dh import parse_modified_dh

SAMPLES = 20_000
TURNS = 15
FLAGS = {"-O2": ["-O2"], "-O3": ["-O3"], "-O3 -march=native": ["-O3", "-march=native"]}

SEVEN_AXES = """
name = "seven axes"
units = "degrees"
gravity = "-z"
joints = [
    {name = "a1", r = 0.333},
    {name = "a2", alpha = -90},
    {name = "a3", alpha = 90, r = 0.316},
    {name = "a4", alpha = 90, d = 0.0825},
    {name = "a5", alpha = -90, d = -0.0825, r = 0.384},
    {name = "a6", alpha = 90},
    {name = "a7", alpha = 90, d = 0.088},
]
"""
SCARA = """
name = "SCARA"
units = "degrees"
gravity = "-z"
joints = [
    {name = "a1", r = 0.4},
    {name = "a2", d = 0.325},
    {name = "slide", kind = "prismatic", alpha = 180, d = 0.275},
    {name = "a4", theta = 90},
]
"""


def main() -> None:
    robots = [load_robot(name) for name in gallery_names()]
    robots += [parse_modified_dh(text) for text in (SEVEN_AXES, SCARA)]
    robots += [load_robot(path) for path in sys.argv[1:]]
    for robot in robots:
        print(f"\n{robot.name}, {robot.size} joints")
        base = base_parameters(robot)
        programs = costs(robot, base)
        deviations(robot, base, programs)
        speeds(robot, base, programs)


def costs(robot: Robot, base: BaseParameters) -> list[Program]:
    """Operations of all models, and the time that it takes to make them."""
    closed_symbols.cache_clear()
    start = time.process_time()
    programs = symbolic_models(robot, None, base)
    seconds = time.process_time() - start
    start = time.process_time()
    inverse_model(robot, base)
    alone = time.process_time() - start
    steps = [closing.step for closing in closings_of(programs)]
    for program in [*programs, *steps]:
        print(f"  {program.name:<34} {program.operation_count}")
    smooth = inverse_model(robot, base, friction=False)
    links = inverse_model(robot, base, friction=False, rotors=False)
    print(f"  {'inverse_model without friction':<34} {smooth.operation_count}")
    print(f"  {'… and without rotors':<34} {links.operation_count}")
    print(f"  made in {seconds:.2f} s, the inverse model alone in {alone:.3f} s")
    return programs


def deviations(robot: Robot, base: BaseParameters, programs: list[Program]) -> None:
    """Generated Python against the kernels."""
    q, dq, ddq, theta = inputs(robot, base, 1000)
    regressor = regressor_of(robot, base.parameters)
    pairs = {
        "torque": (programs[0].function()(q, dq, ddq, theta), regressor.torque(q, dq, ddq, theta)),
        "observation matrix": (programs[1].function()(q, dq, ddq), regressor.matrix(q, dq, ddq)),
    }
    if robot.constraints is None:
        pairs["mass matrix"] = (
            programs[2].function()(q, theta),
            numeric_mass_matrix(robot, base.parameters, theta, q),
        )
    texts = [f"{k} {np.abs(a - b).max() / np.abs(b).max():.1e}" for k, (a, b) in pairs.items()]
    print(f"  deviation from the kernels: {', '.join(texts)}")


def speeds(robot: Robot, base: BaseParameters, programs: list[Program]) -> None:
    """Nanoseconds per state of the kernels and of generated C."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        print("  there is no C compiler, so generated C is not measured")
        return
    n = robot.size
    q, dq, ddq, theta = inputs(robot, base, SAMPLES)
    regressor = regressor_of(robot, base.parameters)
    tau, mass = np.empty((SAMPLES, n)), np.empty((SAMPLES, n, n))
    phi, buffer = np.empty((SAMPLES, n, len(base))), np.zeros((SAMPLES, n, len(base)))
    kernels: list[Callable[[], object]] = [
        lambda: regressor.torque(q, dq, ddq, theta),
        lambda: regressor.matrix(q, dq, ddq, out=buffer),
        lambda: numeric_mass_matrix(robot, base.parameters, theta, q),
    ]
    arrays = [((q, dq, ddq, theta), tau), ((q, dq, ddq), phi), ((q, theta), mass)]
    names = ["torque", "observation matrix", "mass matrix"]
    if robot.constraints is not None:
        kernels, arrays, names = kernels[:2], arrays[:2], names[:2]
    with tempfile.TemporaryDirectory() as folder:
        for label, flags in FLAGS.items():
            library = compiled(compiler, Path(folder), programs[:3], flags)
            texts = []
            for name, kernel, program, (given, out) in zip(
                names, kernels, programs[: len(names)], arrays, strict=True
            ):
                function = getattr(library, f"{program.name}_samples")
                start = [np.array(program.closing.posture)] if program.closing else []
                every = (*given, *start, out)
                pointers = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in every]
                generic, own = best_of(
                    kernel, lambda f=function, p=pointers: f(ctypes.c_size_t(SAMPLES), *p)
                )
                texts.append(f"{name} {generic:.0f} / {own:.0f} ns = {generic / own:.1f}")
            print(f"  kernel / C {label:<18} {', '.join(texts)}")


def compiled(compiler: str, folder: Path, programs: list[Program], flags: list[str]) -> ctypes.CDLL:
    """A library with the generated functions."""
    stem = "_".join(flag.strip("-").replace("=", "_") for flag in flags)
    source, library = folder / f"{stem}.c", folder / f"{stem}.so"
    source.write_text(c_source(programs), encoding="utf-8")
    command = [compiler, "-std=c99", *flags, "-shared", "-fPIC", source, "-o", library, "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library))


def best_of(first: Callable[[], object], second: Callable[[], object]) -> tuple[float, float]:
    """Nanoseconds per state of two functions, in turns so that both see the same machine."""
    times = np.empty((TURNS + 1, 2))
    for k in range(TURNS + 1):
        for i, function in enumerate((first, second)):
            start = time.thread_time()
            function()
            times[k, i] = time.thread_time() - start
    best = times[1:].min(axis=0) / SAMPLES * 1e9
    return float(best[0]), float(best[1])


def inputs(robot: Robot, base: BaseParameters, count: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(1987)
    if robot.constraints is not None:
        rate, at = 0.7 + 0.4 * np.arange(robot.size), 1e-3 * np.arange(count)[:, None]
        reach = np.array([0.3 if joint.kind == "revolute" else 0.05 for joint in robot.joints])
        q = robot.constraints.posture[list(robot.places)] + reach * np.sin(rate * at)
        dq, ddq = reach * rate * np.cos(rate * at), -reach * rate**2 * np.sin(rate * at)
        return q, dq, ddq, rng.uniform(-1.0, 1.0, len(base))
    q, dq, ddq = rng.uniform(-2.0, 2.0, (3, count, robot.size))
    return q, dq, ddq, rng.uniform(-1.0, 1.0, len(base))


if __name__ == "__main__":
    main()
