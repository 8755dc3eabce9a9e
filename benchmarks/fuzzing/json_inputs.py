"""Stored results and manifests to begin with, and other values for their keys."""

from __future__ import annotations

import copy
import json
import random
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fuzzing.mutations import TEXTS
from fuzzing.toml_inputs import STUDY

JSON_CHUNKS = (
    "[" * 100000, '{"a":' * 20000, "1" * 5000, "NaN", "Infinity", "-", "null", "true", '"\\ud800"',
    "\0", '"layout": 1', '"hash": 3', '"programs": 3', '"runs": "x"', '"programs": null', "1e999",
)  # fmt: skip


#: Files that pivident wrote, and those of layouts that it no longer writes.
STORED = Path(__file__).resolve().parents[2] / "tests" / "stored"

#: Values that a place of a file may get.
VALUES = (
    None, True, 0, 1, -1, 10**30, 10**400, 1e308, -5e-324, "", "x", "inf", "nan", [], {}, [None],
    [[1.0]], [[[]]], {"a": 1}, [1.0] * 13, *TEXTS,
)  # fmt: skip


def manifest_seed() -> bytes:
    from pivident.studies.many.study.run import Store
    from pivident.studies.many.study.scenario import read_scenario

    with tempfile.TemporaryDirectory() as folder:
        scenario = read_scenario(STUDY.decode().split("[vary")[0], "study")
        with Store(Path(folder)).opened(scenario, 6):
            pass
        return (Path(folder) / "manifest.json").read_bytes()


@cache
def result_seeds() -> tuple[bytes, bytes]:
    """An identification of the planar arm, and the model made of it, as they are stored."""
    from pivident.data.recording.recording import Recording
    from pivident.dynamics.parameters import nominal_values, standard_parameters
    from pivident.dynamics.regressor import Regressor
    from pivident.estimation.identification_file import to_json
    from pivident.estimation.identify import identify
    from pivident.estimation.problem import Problem
    from pivident.models import model_json
    from pivident.models.runnable_model import runnable_model
    from pivident.robot.gallery import load_robot

    robot, t = load_robot("planar_2r"), np.arange(3000)[:, None] / 500.0
    phase = t * [3.0, 5.0]
    q, dq, ddq = np.sin(phase), [3.0, 5.0] * np.cos(phase), -np.square([3.0, 5.0]) * np.sin(phase)
    standard = standard_parameters(robot)
    tau = Regressor.build(robot, standard).torque(q, dq, ddq, nominal_values(robot, standard))
    tau += 0.1 * np.random.default_rng(1).standard_normal(tau.shape)
    log = Recording("sines", robot.joint_names, q, tau, 500.0, torque_timing="sampled")
    found = identify(Problem(robot, (log,)), "ls")
    return to_json(found).encode(), bytes(model_json.to_json(runnable_model(found)).content)


def grown_json(rng: random.Random, base: bytes) -> bytes:
    """The same keys with values of any kind."""
    content = json.loads(base)
    for key in rng.sample(list(content), rng.randrange(1, 5)):
        content[key] = rng.choice((None, 1, "x", [], {}, [1], {"a": 1}, 1e300, True, list(TEXTS)))
    return json.dumps(content).encode()


def stored_seeds(pattern: str) -> tuple[bytes, ...]:
    """Files of one kind that pivident wrote."""
    return tuple(file.read_bytes() for file in sorted(STORED.glob(pattern)))


def inside_json(data: bytes, rng: random.Random) -> bytes:
    """The same with other values at any depth, or without them."""
    content = json.loads(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        place, key = _place_in(content, rng)
        if rng.random() < 0.15:
            del place[key]
        else:
            place[key] = rng.choice((rng.choice(VALUES), rng.choice(VALUES), _other(content, rng)))
    return json.dumps(content).encode()


def _place_in(content: Any, rng: random.Random) -> tuple[Any, Any]:
    """An object or a list somewhere in content, and a key or index of it."""
    while True:
        key = rng.choice(list(content) if isinstance(content, dict) else range(len(content)))
        inner = content[key]
        if not isinstance(inner, (dict, list)) or not inner or rng.random() < 0.2:
            return content, key
        content = inner


def _other(content: Any, rng: random.Random) -> Any:
    """A copy of what stands at another place."""
    place, key = _place_in(content, rng)
    return copy.deepcopy(place[key])
