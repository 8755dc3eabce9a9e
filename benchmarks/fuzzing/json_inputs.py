"""Stored results and manifests to begin with, and other values for their keys."""

from __future__ import annotations

import json
import random
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from fuzzing.mutations import TEXTS
from fuzzing.toml_inputs import STUDY

JSON_CHUNKS = (
    "[" * 100000, '{"a":' * 20000, "1" * 5000, "NaN", "Infinity", "-", "null", "true", '"\\ud800"',
    "\0", '"layout": 1', '"hash": 3', '"programs": 3', '"runs": "x"', '"programs": null', "1e999",
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
