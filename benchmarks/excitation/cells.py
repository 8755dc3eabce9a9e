"""Robots of the benchmarks, and cells around them: a table, a post, a floor, or drawn at random."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.excitation.ur10e import write_urdf

from pivident.experiment.excite_keys import ExciteEntry
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import read_urdf
from pivident.studies import Clearances, Outline, built_apart, outline_of
from pivident.studies.collision.bodies import upward
from pivident.studies.collision.room import obstacles_of_entries


@dataclass(frozen=True, eq=False)
class Arm:
    """A robot with its bodies, which are looked for once."""

    robot: Robot
    outline: Outline
    apart: frozenset

    @property
    def reach(self) -> float:
        """Length of its links, one after the other [m]."""
        offsets = [np.linalg.norm(joint.translation) for joint in self.robot.joints[1:]]
        return float(np.sum(offsets)) + 0.3

    @property
    def up(self) -> np.ndarray:
        """Unit vector against gravity, in the frame of the base."""
        return upward(self.robot)

    def clearances(self, entry: ExciteEntry) -> Clearances:
        """What must stay apart, as `clearances_of_room` makes it."""
        return Clearances.of(
            self.robot,
            self.outline.bodies,
            obstacles_of_entries(entry.obstacle),
            floor=entry.floor,
            clearance=entry.clearance,
            apart=self.apart,
        )


def arms(
    subjects: list[str], frozen: dict[str, float], folder: Path, rigid: bool = False
) -> list[Arm]:
    """Robots by gallery name, path of a URDF, or ``ur10e``; rigid: their links alone."""
    found = []
    for subject in subjects:
        if subject == "ur10e":
            robot = read_urdf(write_urdf(folder / "ur10e.urdf"))
        elif subject.endswith(".urdf"):
            text = Path(subject).read_text(encoding="utf-8")
            own = {name: value for name, value in frozen.items() if f'"{name}"' in text}
            robot = read_urdf(subject, frozen=own)
        else:
            robot = load_robot(subject)
        robot = robot.with_link_torques() if rigid else robot
        if rigid:
            joints = tuple(replace(joint, friction=FrictionLaw()) for joint in robot.joints)
            robot = replace(robot, joints=joints)
        outline = outline_of(robot)
        apart, _ = built_apart(robot, outline)
        found.append(Arm(robot, outline, frozenset(apart)))
    return found


def table_and_post(arm: Arm) -> ExciteEntry:
    """A table in front of the arm, a post behind it, and a floor."""
    up, reach = arm.up, arm.reach
    upright = [0.0, 0.0, 0.0] if abs(up[2]) > 0.9 else [90.0, 0.0, 0.0]
    front = np.array([1.0, 0.0, 0.0])
    side = np.array([0.5, 0.5, 0.5]) * reach
    side[np.abs(up) > 0.9] = 0.04
    return ExciteEntry.model_validate(
        {
            "floor": -0.45,
            "obstacle": [
                {
                    "name": "table",
                    "shape": "box",
                    "size": side.tolist(),
                    "at": (0.75 * reach * front - 0.2 * up).tolist(),
                },
                {
                    "name": "post",
                    "shape": "cylinder",
                    "radius": 0.05,
                    "length": 2.0 * reach,
                    "at": (-0.7 * reach * front).tolist(),
                    "rpy_degrees": upright,
                },
            ],
        }
    )


def random_cell(arm: Arm, rng: np.random.Generator) -> ExciteEntry:
    """One to four solids around the robot that leave a free posture, and shares of its limits."""
    while True:
        entry = ExciteEntry.model_validate(
            {
                "obstacle": [_solid(arm, k, rng) for k in range(rng.integers(1, 5))],
                "speed": float(rng.uniform(0.3, 1.0)),
                "torque": float(rng.uniform(0.6, 1.0)),
                "floor": float(rng.uniform(-0.6, -0.2)) if rng.random() < 0.3 else None,
                "clearance": float(rng.choice([0.0, 0.02, 0.05])),
            }
        )
        clearances = arm.clearances(entry)
        limits = np.array([j.position_limits for j in arm.robot.joints])
        q = rng.uniform(*limits.T, (200, arm.robot.size))
        if (clearances.distances(q) > clearances.needed[:, None] + 0.01).all(axis=0).any():
            return entry


def _solid(arm: Arm, number: int, rng: np.random.Generator) -> dict:
    """A box, sphere or cylinder at 0.3 to 1.1 times the reach."""
    way = rng.standard_normal(3)
    if np.array([abs(j.rotation[2, 2]) > 0.999 for j in arm.robot.joints]).all():
        way[2] *= 0.1  # a planar arm meets only what is in its plane
    place = way / np.linalg.norm(way) * rng.uniform(0.3, 1.1) * arm.reach
    shape = str(rng.choice(["box", "sphere", "cylinder"]))
    made = {"name": f"{shape} {number}", "shape": shape, "at": place.tolist()}
    if shape != "sphere":
        made["rpy_degrees"] = rng.uniform(-180.0, 180.0, 3).tolist()
    if shape == "box":
        return made | {"size": rng.uniform(0.05, 0.6, 3).tolist()}
    made["radius"] = float(rng.uniform(0.03, 0.25))
    return made if shape == "sphere" else made | {"length": float(rng.uniform(0.1, 1.0))}
