"""A model as one Python file that needs nothing but NumPy.

It has the functions ``inverse_dynamics(q, dq, ddq)``, ``gravity(q)``, ``mass_matrix(q)`` and
``regressor(q, dq, ddq)``, each for one state or many, and the constants ``JOINTS``, ``PARAMETERS``
and ``THETA`` with ``regressor(q, dq, ddq) @ THETA`` the torque.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from pivident.dynamics.forward import mass_matrix
from pivident.export.exported import ExportedText, Verification, compared, random_states
from pivident.export.model_programs import (
    header_lines,
    inner_columns,
    model_columns,
    model_programs,
)
from pivident.export.runnable_model import RunnableModel

#: A function of positions, speeds and accelerations, each (states, joints).
State = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def to_numpy(model: RunnableModel) -> ExportedText:
    """The model as a Python module.

    Args:
        model: the model.
    """
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
    """What functions of one state cannot say of a model.

    Args:
        model: the model.
    """
    with_memory = sorted(
        model.robot.joints[p.joint].name
        for p in model.base.parameters
        if p.friction is not None and p.friction.has_memory
    )
    if not with_memory:
        return ()
    joints = ", ".join(map(repr, dict.fromkeys(with_memory)))
    return (
        f"friction of {joints} remembers the path: its columns are the argument `inner` of the "
        "functions, to be integrated by the caller",
    )


def verify_numpy(exported: ExportedText, model: RunnableModel) -> Verification:
    """Torque of the file against the model's, with its regressor, mass matrix and gravity.

    Args:
        exported: what `to_numpy` returned.
        model: the model.
    """
    loaded: dict[str, Any] = {}
    exec(compile(exported.content, "the exported module", "exec"), loaded)
    return verify_functions(f"NumPy {np.__version__}", loaded, model)


def verify_functions(program: str, loaded: dict[str, Any], model: RunnableModel) -> Verification:
    """Loaded functions of many states against the model's; the worst of them is reported.

    Args:
        program: who computes them.
        loaded: ``inverse_dynamics gravity mass_matrix regressor THETA``.
        model: the model.
    """
    parameters, values = _rigid(model)

    def torque(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        memory, _ = inner_columns(model, q, dq, ddq)
        return loaded["inverse_dynamics"](q, dq, ddq, *([memory] if memory.size else []))

    def by_regressor(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        _, inner = inner_columns(model, q, dq, ddq)
        phi = loaded["regressor"](q, dq, ddq, *([inner] if inner.size else []))
        return phi @ np.asarray(loaded["THETA"])

    pairs: dict[str, tuple[State, State]] = {
        "torques": (model.torque, torque),
        "torques by the regressor": (model.torque, by_regressor),
        "gravity torques": (
            lambda q, dq, ddq: rigid_torque(model, q, 0.0 * q, 0.0 * q),
            lambda q, dq, ddq: loaded["gravity"](q),
        ),
        "mass matrices": (
            lambda q, dq, ddq: mass_matrix(model.robot, parameters, values, q),
            lambda q, dq, ddq: loaded["mass_matrix"](q),
        ),
    }
    usual = float(np.abs(model.torque(*random_states(model.robot))).max())
    found = [
        compared(
            program,
            model.robot,
            ours,
            theirs,
            what=what,
            usual=usual if what == "gravity torques" else 0.0,
        )
        for what, (ours, theirs) in pairs.items()
    ]
    worst = max(found, key=lambda v: np.inf if np.isnan(v.relative) else v.relative)
    return replace(worst, compared=f"{', '.join(pairs)} (worst: {worst.compared})")


def rigid_torque(
    model: RunnableModel, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> np.ndarray:
    """Torque of the links alone, without rotors and friction, shape (samples, joints).

    Args:
        model: the model.
        q: joint positions, shape (samples, joints); ``dq ddq`` likewise.
        dq: joint speeds.
        ddq: joint accelerations.
    """
    bodies = np.where([p.is_inertial for p in model.parameters], model.values, 0.0)
    return model.regressor.torque(q, dq, ddq, bodies)


def _rigid(model: RunnableModel) -> tuple[Any, np.ndarray]:
    """Parameters of links and rotors with their values."""
    kept = [p.is_inertial or p.stem in ("ia", "iam") for p in model.parameters]
    chosen = tuple(p for p, k in zip(model.parameters, kept, strict=True) if k)
    return chosen, model.values[np.array(kept)]


def _literal(names: tuple[str, ...]) -> str:
    """A tuple of texts in ASCII, whatever is in them."""
    return "(" + "".join(f"{name!a}, " for name in names).rstrip() + ")"
