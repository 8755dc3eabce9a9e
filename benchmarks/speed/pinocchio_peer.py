"""Pinocchio beside us: its loops called from Python, and from C++ where it can be compiled."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from pivident.robot.description import Robot

#: Pinocchio has more kinds of joints, and functions of more arguments, than Boost is prepared for.
#: Its algorithms are taken from its library, where they are compiled already.
_DEFINITIONS = (
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=10",
    "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
)

SOURCE = Path(__file__).with_name("pinocchio_loops.cpp")


def model_of(robot: Robot):
    """The robot's tree and nominal links for Pinocchio: the module, the model, its data."""
    import pinocchio as pin

    model = pin.Model()
    for joint, link in zip(robot.joints, robot.links, strict=True):
        place = pin.SE3(joint.rotation, joint.translation)
        added = model.addJoint(joint.parent + 1, pin.JointModelRZ(), place, joint.name)
        xx, xy, xz, yy, yz, zz, mx, my, mz, m = link.inertia
        dynamic = np.array([m, mx, my, mz, xx, xy, yy, xz, yz, zz])
        inertia = pin.Inertia.FromDynamicParameters(dynamic) if m > 0 else pin.Inertia.Random()
        model.appendBodyToJoint(added, inertia, pin.SE3.Identity())
    model.armature[:] = robot.rotor_inertia
    return pin, model, model.createData()


def regressor_loop(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray):
    """Observation matrix sample by sample from Python, as its users do."""
    pin, model, data = model_of(robot)
    out = np.empty((len(q), robot.size, 10 * robot.size))

    def work() -> None:
        for k in range(len(q)):
            out[k] = pin.computeJointTorqueRegressor(model, data, q[k], dq[k], ddq[k])

    return work


def runge_kutta_loop(robot: Robot, q: np.ndarray, dq: np.ndarray, kp: np.ndarray, kd: np.ndarray):
    """The loop under a proportional-derivative law from Python: Runge-Kutta 4, one substep.

    Without friction, which would make it diverge on the wrist (``docs/speed.md``) and cost more.
    """
    pin, model, data = model_of(robot)
    h = 2e-4

    def work() -> np.ndarray:
        x, v = q[0].copy(), dq[0].copy()
        for k in range(len(q)):
            tau = kp * (q[k] - x) + kd * (dq[k] - v)
            a1 = pin.aba(model, data, x, v, tau).copy()
            v2 = v + 0.5 * h * a1
            a2 = pin.aba(model, data, x + 0.5 * h * v, v2, tau).copy()
            v3 = v + 0.5 * h * a2
            a3 = pin.aba(model, data, x + 0.5 * h * v2, v3, tau).copy()
            v4 = v + h * a3
            a4 = pin.aba(model, data, x + h * v3, v4, tau)
            x = x + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
            v = v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        return x

    return work


def compiled_loops(
    robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, folder: Path, repeats: int
) -> tuple[dict[str, float], str]:
    """Pinocchio's loops in C++: processor time [ms] by name, or nothing and the reason.

    ``CPPFLAGS`` may name the folder of Eigen's headers (``-I...``).

    Args:
        robot: the robot.
        q: joint positions, shape (samples, joints); the next two likewise.
        dq: joint speeds.
        ddq: joint accelerations.
        folder: for the compiled program and its input.
        repeats: turns, of which the median counts.
    """
    program = folder / "pinocchio_loops"
    if not program.exists() or program.stat().st_mtime < SOURCE.stat().st_mtime:
        if reason := _compile(program):
            return {}, reason
    _write_input(robot, q, dq, ddq, folder / "input.bin")
    ran = subprocess.run(
        [str(program), str(folder / "input.bin"), str(repeats)], capture_output=True, text=True
    )
    if ran.returncode:
        return {}, f"it ended with {ran.returncode}: {ran.stderr.strip()[-200:]}"
    words = [line.split() for line in ran.stdout.splitlines()]
    return {name: float(ms) for name, ms in words}, ""


def _compile(program: Path) -> str:
    """Compile the loops, which takes two minutes; what went wrong, or nothing."""
    compiler = shutil.which(os.environ.get("CXX", "g++"))
    if compiler is None:
        return "there is no C++ compiler"
    import pinocchio

    prefix = Path(pinocchio.__file__).parents[4]
    includes = [f"-I{prefix / 'include'}"]
    eigen = [Path("/usr/include/eigen3"), prefix / "include" / "eigen3"]
    includes += [f"-I{place}" for place in eigen if place.is_dir()]
    includes += os.environ.get("CPPFLAGS", "").split()
    libraries = prefix / "lib"
    command = [compiler, "-O2", "-DNDEBUG", "-std=c++17", *_DEFINITIONS, *includes]
    command += [str(SOURCE), f"-L{libraries}", "-lpinocchio_default", f"-Wl,-rpath,{libraries}"]
    made = subprocess.run([*command, "-o", str(program)], capture_output=True, text=True)
    if made.returncode:
        missing = [line for line in made.stderr.splitlines() if "error" in line]
        return f"it does not compile here: {missing[0] if missing else made.stderr[-200:]}"
    return ""


def _write_input(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, path: Path) -> None:
    """Tree, links and motion as numbers for the program."""
    rows = [np.array([robot.size, len(q)], dtype=float)]
    for joint, link in zip(robot.joints, robot.links, strict=True):
        xx, xy, xz, yy, yz, zz, mx, my, mz, m = link.inertia
        dynamic = [m, mx, my, mz, xx, xy, yy, xz, yz, zz]
        rows.append(np.r_[joint.parent, joint.rotation.ravel(), joint.translation, dynamic])
    rows += [robot.rotor_inertia, *(np.ascontiguousarray(x).ravel() for x in (q, dq, ddq))]
    np.concatenate(rows).astype(float).tofile(path)
