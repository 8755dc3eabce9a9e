"""A model as one Python file that needs only NumPy.

It has the functions ``inverse_dynamics(q, dq, ddq)``, ``gravity(q)``, ``mass_matrix(q)`` and
``regressor(q, dq, ddq)``, each for one state or many, and the constants ``JOINTS``, ``PARAMETERS``
and ``THETA`` with ``regressor(q, dq, ddq) @ THETA`` the torque.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pivident.dynamics.forward import mass_matrix
from pivident.errors import ExportError
from pivident.export.model_programs import (
    header_lines,
    inner_columns,
    model_columns,
    model_programs,
)
from pivident.models.export_format import Format
from pivident.models.exported import ExportedText, Verification, compared_values, random_states
from pivident.models.runnable_model import RunnableModel

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


def to_numpy(model: RunnableModel) -> ExportedText:
    """The model as a Python module."""
    from pivident.symbolic.print_python import python_module

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
