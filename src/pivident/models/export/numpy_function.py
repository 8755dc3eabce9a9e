"""A model as a program with its numbers folded in, and as one Python file that needs only NumPy.

It has the functions ``inverse_dynamics(q, dq, ddq)``, ``gravity(q)``, ``mass_matrix(q)`` and
``regressor(q, dq, ddq)``, each for one state or many, and the constants ``JOINTS``, ``PARAMETERS``
and ``THETA`` with ``regressor(q, dq, ddq) @ THETA`` the torque.

A model as programs with its numbers folded in, the source of C and NumPy files.

The programs are customised to the robot (see `pivident.models.symbolic`) and written in the base
parameters, which give the same torques with fewer operations than the standard ones.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.errors import ExportError
from pivident.foundation.text.identifiers import one_line
from pivident.models.export_format import Format
from pivident.models.exported import ExportedText, Verification, compared_values, random_states
from pivident.models.runnable_model import RunnableModel

if TYPE_CHECKING:
    from pivident.models.symbolic.program import Program

#: Time limit of the check of a file [s].
TIMEOUT = 120.0
#: Exit status of a child process without NumPy.
_NO_NUMPY = 3
#: The child process loads the file, calls its functions and writes what they return.
_IN_THE_CHILD = f"""
import importlib.util, pathlib, sys
try:
    import numpy
except ImportError:
    sys.exit({_NO_NUMPY})
folder = pathlib.Path(sys.argv[1])
spec = importlib.util.spec_from_file_location("model", folder / "model.py")
model = importlib.util.module_from_spec(spec)
spec.loader.exec_module(model)
signals = {{}}
with numpy.load(folder / "signals.npz", allow_pickle=False) as file:
    for key in sorted(file.files):
        signals.setdefault(key.rpartition(".")[0], []).append(file[key])
results = {{name: getattr(model, name)(*given) for name, given in signals.items()}}
numpy.savez(folder / "results.npz", THETA=model.THETA, **results)
"""
#: Names of the programs in the exported file.
NAMES = ("inverse_dynamics", "gravity", "mass_matrix", "regressor")


@dataclass(frozen=True, eq=False)
class ModelColumns:
    """The parameters that the programs are written in: base parameters, or standard ones."""

    columns: BaseParameters | tuple[Parameter, ...]
    parameters: tuple[Parameter, ...]  # columns of the observation matrix
    names: tuple[str, ...]
    values: np.ndarray  # (parameters,)


def model_columns(model: RunnableModel) -> ModelColumns:
    """Base parameters; standard ones where friction is grouped with them."""
    if friction_in_groups(model.base):
        names = tuple(p.name for p in model.parameters)
        return ModelColumns(model.parameters, model.parameters, names, model.values)
    base = model.base
    return ModelColumns(base, base.parameters, base.names, model.base_values)


def model_programs(model: RunnableModel) -> tuple[Program, ...]:
    """Inverse dynamics with friction, gravity, mass matrix, and observation matrix."""
    from pivident.models.symbolic.composite_bodies import gravity_vector, mass_matrix
    from pivident.models.symbolic.newton_euler import inverse_model, observation_matrix

    robot, own = model.robot, model_columns(model)
    programs = (
        inverse_model(robot, own.columns, own.values),
        gravity_vector(robot, own.columns, own.values),
        mass_matrix(robot, own.columns, own.values),
        observation_matrix(robot, own.columns),
    )
    return tuple(replace(p, name=name) for p, name in zip(programs, NAMES, strict=True))


def friction_in_groups(base: BaseParameters) -> bool:
    """Whether some friction is indistinguishable from gravity, and grouped with it.

    That is so with a ripple of order one, with struts, and with the offset of a joint whose weight
    does not depend on the positions. Gravity alone, and the load of load-dependent friction, then
    need the standard parameters.
    """
    heads = np.array([base.standard[k].friction is not None for k in base.kept], dtype=bool)
    others = np.array([base.standard[k].friction is not None for k in base.dropped], dtype=bool)
    return bool((base.regrouping != 0.0)[heads[:, None] != others].any())


def provenance_lines(model: RunnableModel) -> list[str]:
    """Beginning of a header: robot, which parameters of which method, what is said against them."""
    made = (
        "the consistent set, which a machine can have"
        if model.consistent
        else "the estimate, not made physically consistent"
    )
    by = f"exported by pivident {one_line(model.origin.version)}".rstrip()
    lines = [
        f"Dynamic model of {one_line(model.robot.name)}, {by}.",
        f"Parameters: {one_line(model.origin.method)}, {made}.",
    ]
    for note in model.notes:
        lines += textwrap.wrap(one_line(note), 96)
    return lines


def header_lines(model: RunnableModel) -> list[str]:
    """Header of an exported program: robot, origin, joints with units, frames."""
    origin, robot = model.origin, model.robot
    lines = provenance_lines(model)
    if origin.identification:
        lines.append(f"SHA-256 of the identification: {one_line(origin.identification)}")
    lines += [
        *(f"SHA-256 of {one_line(k)}: {one_line(v)}" for k, v in origin.sources.items()),
        "Joints, in order, position and torque on the joint side:",
    ]
    for i, joint in enumerate(robot.joints):
        units = "rad, N m" if joint.kind == "revolute" else "m, N"
        lines.append(f"  {i + 1} {one_line(joint.name)}: {joint.kind} [{units}]")
    if robot.constraints is not None:
        along = ", ".join(one_line(joint.name) for joint in robot.passive_joints)
        text = f"They move {along} along, whose inertia, weight and friction are in their torques."
        lines += textwrap.wrap(text, 96)
        lines.append("Results are NaN where the loops do not close.")
    gravity = ", ".join(repr(g) for g in robot.gravity.tolist())
    lines += [
        f"Gravity in the base frame: ({gravity}) m/s^2. Link frames have the joint's axis",
        "as z. Torques are those that the drives must give, friction included.",
    ]
    return lines


def inner_columns(
    model: RunnableModel, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The argument ``inner`` of inverse dynamics (memory) and observation matrix (memory, load).

    The states (samples, joints) are taken as one path.
    """
    own = model_columns(model)
    regressor = regressor_of(model.robot, own.parameters)
    inner = regressor.inner(q.T, dq.T, ddq.T, own.values).T
    terms = [regressor.parameters[k].friction for k in regressor.column[regressor.inner_entries]]
    memory = np.array([t is not None and t.has_memory for t in terms], dtype=bool)
    return inner[:, memory], inner


def to_numpy(model: RunnableModel) -> ExportedText:
    """The model as a Python module."""
    from pivident.models.symbolic.print_python import python_module

    functions = python_module(model_programs(model)).partition("import numpy as np\n")[2]
    comment = "\n".join(f"# {line}".rstrip() for line in header_lines(model))
    own = model_columns(model)
    theta = ",\n".join(f"    {value!r}" for value in own.values.tolist())
    constants = (
        f"JOINTS = {_literal(model.robot.joint_names)}\n"
        f"PARAMETERS = {_literal(own.names)}\n"
        f"THETA = np.array([\n{theta},\n])\n"
    )
    text = f"{comment}\n\nimport numpy as np\n\n{constants}{functions}"
    return ExportedText(text.encode("utf-8", errors="backslashreplace"), program_differences(model))


def program_differences(model: RunnableModel) -> tuple[str, ...]:
    """Properties of a model that functions of one state cannot represent."""
    with_memory = sorted(
        model.robot.joints[p.joint].name
        for p in model.base.parameters
        if p.friction is not None and p.friction.has_memory
    )
    if not with_memory:
        return ()
    joints = ", ".join(map(repr, dict.fromkeys(with_memory)))
    return (
        f"friction of {joints} has a memory: its columns are the argument `inner` of the "
        "functions, to be integrated by the caller",
    )


def verify_numpy(exported: ExportedText, model: RunnableModel) -> Verification:
    """Torque of the file against the model's, with its regressor, mass matrix and gravity.

    The file runs in an isolated interpreter, without pivident.
    """
    program = f"NumPy {np.__version__}"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        (Path(folder) / "model.py").write_bytes(exported.content)
        given = {
            f"{name}.{k}": signal
            for name, signals in check_signals(model).items()
            for k, signal in enumerate(signals)
        }
        np.savez(Path(folder) / "signals.npz", allow_pickle=False, **given)
        try:
            done = subprocess.run(
                [sys.executable, "-I", "-c", _IN_THE_CHILD, folder],
                capture_output=True,
                text=True,
                errors="replace",
                timeout=TIMEOUT,
            )
        except (OSError, subprocess.SubprocessError) as error:
            return Verification(program, skipped=f"no Python could be started ({error})")
        if done.returncode == _NO_NUMPY:
            return Verification(program, skipped=f"{sys.executable} -I finds no NumPy")
        if done.returncode:
            said = " ".join(done.stderr.split())[-400:]
            raise ExportError(f"the Python file does not run: {said}")
        with np.load(Path(folder) / "results.npz", allow_pickle=False) as results:
            return verify_functions(program, dict(results), model)


def check_signals(model: RunnableModel) -> dict[str, tuple[np.ndarray, ...]]:
    """Arguments of each exported function in the check."""
    q, dq, ddq = random_states(model.robot)
    memory, inner = inner_columns(model, q, dq, ddq)
    return {
        "inverse_dynamics": (q, dq, ddq, *((memory,) if memory.size else ())),
        "gravity": (q,),
        "mass_matrix": (q,),
        "regressor": (q, dq, ddq, *((inner,) if inner.size else ())),
    }


def verify_functions(
    program: str, found: Mapping[str, np.ndarray], model: RunnableModel
) -> Verification:
    """Results of a file for `check_signals` against the model's; the worst is reported."""
    parameters, values = _rigid(model)
    q, dq, ddq = random_states(model.robot)
    torque = model.torque(q, dq, ddq)
    pairs = {
        "torques": (torque, found["inverse_dynamics"]),
        "torques by the regressor": (torque, found["regressor"] @ found["THETA"]),
        "gravity torques": (rigid_torque(model, q, 0.0 * q, 0.0 * q), found["gravity"]),
        "mass matrices": (
            mass_matrix(model.robot, parameters, values, q),
            found["mass_matrix"],
        ),
    }
    usual = float(np.abs(torque).max())
    checks = [
        compared_values(
            program, ours, theirs, what=what, usual=usual if what == "gravity torques" else 0.0
        )
        for what, (ours, theirs) in pairs.items()
    ]
    worst = max(checks, key=lambda v: np.inf if np.isnan(v.relative) else v.relative)
    return replace(worst, compared=f"{', '.join(pairs)} (worst: {worst.compared})")


def rigid_torque(
    model: RunnableModel, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> np.ndarray:
    """Torque of the links alone, without rotors and friction, shape (samples, joints)."""
    bodies = np.where([p.is_inertial for p in model.parameters], model.values, 0.0)
    return model.regressor.torque(q, dq, ddq, bodies)


def _rigid(model: RunnableModel) -> tuple[Any, np.ndarray]:
    """Parameters of links and rotors with their values."""
    kept = [p.is_inertial or p.stem in ("ia", "iam") for p in model.parameters]
    chosen = tuple(p for p, k in zip(model.parameters, kept, strict=True) if k)
    return chosen, model.values[np.array(kept)]


def _literal(names: tuple[str, ...]) -> str:
    """A tuple of texts as an ASCII literal."""
    return "(" + "".join(f"{name!a}, " for name in names).rstrip() + ")"


#: Functions of NumPy arrays.
NUMPY = Format(
    "Python with NumPy",
    ".py",
    lambda model, _: to_numpy(model),
    (lambda file, model, _: verify_numpy(file, model),),
)
