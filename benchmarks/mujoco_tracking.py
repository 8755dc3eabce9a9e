"""An exported TX40 in MuJoCo: does it track the positions that our own simulator tracks?

    [PIVIDENT_DATA=FOLDER] python benchmarks/mujoco_tracking.py [--samples 34500]

Two loops. The simulated record *fine*: the robot's nominal parameters under the law that made the
record. The real record of the TX40: identified with IDIM-PIV, made physically consistent, under
the virtual PD law along the measured motion. Each is run by our simulator, by its Runge–Kutta
oracle, and by MuJoCo with the exported MJCF: with MuJoCo's dry friction (a constraint with a sharp
sign) and with the model's (smooth, by hand), with several integrators and steps per control period
of 0.2 ms. A further row is our simulator with a sign a hundred times as sharp: what is left between
it and MuJoCo's own friction is MuJoCo's regularisation, the rest is the smoothing.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

import numpy as np
from mujoco_loop import simulate_in_mujoco

from pivident.dynamics.forward import make_model
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.identify import identify
from pivident.experiment import simulated_tx40 as scenarios
from pivident.experiment.experiment import load_experiment
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import Controller
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.export.load_back import verify_with_mujoco
from pivident.models.export.mjcf import to_mjcf
from pivident.models.runnable_model import RunnableModel, runnable_model
from pivident.robot.gallery import load_robot

#: Friction, integrator, steps per control period.
RUNS = (
    ("mujoco", "euler", 1),
    ("mujoco", "implicitfast", 1),
    ("mujoco", "implicitfast", 4),
    ("mujoco", "rk4", 1),
    ("model", "euler", 1),
    ("model", "implicitfast", 1),
    ("model", "implicitfast", 4),
    ("model", "rk4", 1),
    ("model", "rk4", 4),
)

Start = tuple[np.ndarray, np.ndarray] | None


def simulated(samples: int) -> tuple[RunnableModel, Controller, LoopSignals, Start]:
    """The scenario *fine* without noise, the robot's nominal values."""
    problem, _ = scenarios.tx40_fine(samples=samples)
    signals, start = AuxiliaryModel(problem, differences=False).signals[0]
    return runnable_model(load_robot("staubli_tx40")), problem.loop.controller, signals, start


def measured(samples: int) -> tuple[RunnableModel, Controller, LoopSignals, Start]:
    """The real record, its consistent parameters and its virtual law."""
    here = Path(__file__).parents[1] / "examples" / "staubli_tx40" / "experiment.toml"
    problem = load_experiment(here).problem()
    model = runnable_model(make_consistent(identify(problem, "piv")))
    auxiliary = AuxiliaryModel(problem, differences=False)
    signals, start = auxiliary.signals[0]
    return model, auxiliary.loop.controller, signals, start


def sharper(model: RunnableModel) -> RunnableModel:
    """The same model with a sign a hundred times as sharp."""
    joints = []
    for joint in model.robot.joints:
        gammas = [t.gamma for t in joint.friction.terms if t.has_sign and t.gamma]
        joints.append((joint.name, joint.friction.with_shapes({"gamma": 100.0 * gammas[0]})))
    return runnable_model(model.robot.with_friction(dict(joints)))


def compare(name: str, case: tuple[RunnableModel, Controller, LoopSignals, Start]) -> list[dict]:
    """Rows of one loop: difference of the positions from our simulator's oracle."""
    model, controller, signals, start = case
    names = model.robot.joint_names

    def ours(of: RunnableModel, oracle: int | None = None) -> np.ndarray:
        arranged = make_model(of.robot, of.parameters, model.values)
        return simulate(arranged, controller, signals, names, start, oracle).q

    file = to_mjcf(model)
    print(f"\n{name}: {verify_with_mujoco(file, model)}")
    exact = ours(model, 20)
    error = exact - signals.q_ref
    print(
        f"distance of the loop from its reference: rms {1e3 * _rms(error):.4f} mrad, largest "
        f"{1e3 * np.abs(error).max():.3f} mrad\n"
        "friction  integrator     step      rms        largest    by joint, largest"
        "                                    to reference     s"
    )
    rows = []

    def row(friction: str, integrator: str, steps: int, run) -> None:
        began = time.perf_counter()
        found = run()
        off = found - exact
        seconds = time.perf_counter() - began
        rows.append(
            {
                "loop": name,
                "friction": friction,
                "integrator": integrator,
                "steps": steps,
                "rms_rad": _rms(off),
                "largest_rad": float(np.abs(off).max()),
                "rms_to_reference_rad": _rms(found - signals.q_ref),
                "largest_by_joint_rad": np.abs(off).max(axis=0).tolist(),
                "seconds": seconds,
            }
        )
        by_joint = " ".join(f"{x:.1e}" for x in np.abs(off).max(axis=0))
        print(
            f"{friction:9s} {integrator:13s} {200 / steps:4.0f} µs   {_rms(off):.2e}   "
            f"{np.abs(off).max():.2e}   {by_joint}   {1e3 * _rms(found - signals.q_ref):8.4f} mrad"
            f"   {seconds:.1f}",
            flush=True,
        )

    row("model", "pivident", 1, lambda: ours(model))
    row("sharp", "pivident", 1, lambda: ours(sharper(model)))
    for friction, integrator, steps in RUNS:
        row(
            friction,
            integrator,
            steps,
            lambda f=friction, i=integrator, s=steps: simulate_in_mujoco(
                file, model, controller, signals, start, steps=s, integrator=i, friction=f
            ),
        )
    return rows


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=34500)
    options = parser.parse_args()
    rows = compare("simulated TX40", simulated(options.samples))
    if "PIVIDENT_DATA" in os.environ:
        rows += compare("real TX40", measured(options.samples))
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    (target / "mujoco_tracking.json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
