"""FIGAROH's least squares beside us, where it is installed.

Only its two modules that are needed are loaded, ``tools/regressor.py`` and
``tools/qrdecomposition.py``: the package imports viewers and optimisers that least squares do not
need. What is timed is what its users run: regressor of all standard parameters with friction,
rotor inertia and offset, columns without effect taken out, base parameters and estimate by QR.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np

from pivident.robot.description import Robot

from .pinocchio_peer import model_of


def least_squares(
    robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, tau: np.ndarray
) -> tuple[Callable[[], object] | None, str]:
    """The work, or nothing and the reason.

    Args:
        robot: the robot.
        q: joint positions, shape (samples, joints); the next three likewise.
        dq: joint speeds.
        ddq: joint accelerations.
        tau: torques.
    """
    found = importlib.util.find_spec("figaroh")
    if found is None or not found.submodule_search_locations:
        return None, "not installed; pip install figaroh"
    tools = Path(found.submodule_search_locations[0]) / "tools"
    try:
        regressor = _module("figaroh_regressor", tools / "regressor.py")
        decomposition = _module("figaroh_qr", tools / "qrdecomposition.py")
    except (ImportError, OSError) as error:
        return None, f"its modules cannot be loaded: {error}"
    _, model, data = model_of(robot)
    machine = SimpleNamespace(model=model, data=data)
    setting = {
        "has_friction": True,
        "has_actuator_inertia": True,
        "has_joint_offset": True,
        "is_joint_torques": True,
        "act_idxv": list(range(robot.size)),
    }
    stacked = np.ascontiguousarray(tau.T).ravel()

    def work() -> object:
        whole = regressor.build_regressor_basic(machine, q, dq, ddq, setting)
        names = {f"p{k}": 0.0 for k in range(whole.shape[1])}
        reduced, kept = regressor.eliminate_non_dynaffect(whole, names)
        decomposer = decomposition.QRDecomposer()
        return decomposer.double_decomposition(stacked, reduced, kept, names)

    return work, ""


def _module(name: str, path: Path) -> ModuleType:
    """A module from its file, without the package around it."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # its dataclasses look themselves up
    spec.loader.exec_module(module)
    return module
