"""How much room the capsules of a robot give away, against its own shapes.

For each URDF, with random postures within the limits of its joints: the pairs of links that are
checked, the distance of their capsules and that of their shapes (coal), and the difference of the
two, the *margin*, wherever the shapes do not touch. A negative margin would be a capsule that does
not enclose its shape. The time is that of distances and gradients of 200 samples of a motion.

    python benchmarks/collision_margins.py arm.urdf other.urdf --frozen finger_joint=0.02
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

from pivident.robot.description import Robot
from pivident.robot.urdf import read_urdf
from pivident.studies.collision.bodies import Body
from pivident.studies.collision.clearances import Clearances
from pivident.studies.collision.outlines import outline_of
from pivident.studies.collision.room import built_apart, exact_distances

#: What rounding, and the tolerance of coal, may take from a margin [m].
TOLERANCE = 1e-5


def postures(robot: Robot, count: int, seed: int) -> np.ndarray:
    limits = np.array([j.position_limits or (-np.pi, np.pi) for j in robot.joints])
    return np.random.default_rng(seed).uniform(*limits.T, (count, robot.size))


def motion(robot: Robot, samples: int = 200) -> np.ndarray:
    """Sines through 70 % of the range of each joint."""
    limits = np.array([j.position_limits or (-np.pi, np.pi) for j in robot.joints])
    t = np.linspace(0.0, 1.0, samples)[:, None]
    rate = 1 + np.arange(robot.size) % 4
    swing = np.sin(2.0 * np.pi * rate * t + np.arange(robot.size))
    return limits.mean(axis=1) + 0.35 * np.ptp(limits, axis=1) * swing


def milliseconds(clearances: Clearances, repetitions: int = 15) -> float:
    q, took = motion(clearances.robot), []
    for _ in range(repetitions):
        start = time.perf_counter()
        clearances.with_gradients(q)
        took.append(time.perf_counter() - start)
    return 1e3 * float(np.median(took))


def whole_pairs(clearances: Clearances, bodies: tuple[Body, ...]) -> list[tuple[int, int]]:
    """Pairs of links of which all bodies are checked: the shapes are measured link by link."""
    checked = Counter((p.body.link, p.other.link) for p in clearances.pairs)
    own = Counter(body.link for body in bodies)
    return sorted(pair for pair, n in checked.items() if n == own[pair[0]] * own[pair[1]])


def margins(path: str, frozen: dict[str, float], count: int, near: float) -> int:
    """Print the table of one robot; returns the number of violations."""
    robot = read_urdf(path, frozen=frozen)
    outline = outline_of(robot)
    bodies = outline.bodies
    start = time.perf_counter()
    apart, remarks = built_apart(robot, outline)
    took = time.perf_counter() - start
    clearances = Clearances.of(robot, bodies, apart=apart)
    links = whole_pairs(clearances, bodies)
    q = postures(robot, count, seed=5)
    found = clearances.distances(q)
    capsule = np.array(
        [
            found[[(p.body.link, p.other.link) == pair for p in clearances.pairs]].min(axis=0)
            for pair in links
        ]
    )
    exact = exact_distances(robot, links, q)
    apart = exact > 0.0
    margin = (exact - capsule)[apart]
    close = (exact - capsule)[apart & (exact < near)]
    violations = int(np.sum(margin < -TOLERANCE))
    print(f"\n{robot.name}: {len(bodies)} capsules, {len(links)} pairs of links, {count} postures")
    for what, values in (("all", margin), (f"nearer than {near:g} m", close)):
        if len(values):
            least, median, most = np.quantile(values, [0.0, 0.5, 0.95])
            print(
                f"  margin, {what}: least {1e3 * least:.2f}, median {1e3 * median:.1f}, "
                f"95 % {1e3 * most:.1f} mm ({len(values)} distances)"
            )
    lost = np.mean((capsule < 0.0).any(axis=0) & apart.all(axis=0))
    print(
        f"  postures in which links touch: {100 * np.mean(~apart.all(axis=0)):.1f} %; only "
        f"capsules: {100 * lost:.1f} %; violations: {violations}; "
        f"{len(clearances.pairs)} rows, 200 samples: {milliseconds(clearances):.1f} ms"
    )
    print(f"  shapes of links two joints apart looked at in {took:.1f} s")
    for remark in (*remarks, *clearances.remarks):
        print(f"  {remark}")
    return violations


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("urdfs", nargs="+")
    parser.add_argument("--frozen", nargs="*", default=[], metavar="JOINT=POSITION")
    parser.add_argument("--postures", type=int, default=1000)
    parser.add_argument("--near", type=float, default=0.2, help="of the second line [m]")
    options = parser.parse_args()
    frozen = {name: float(value) for name, value in (f.split("=") for f in options.frozen)}
    total = 0
    for path in options.urdfs:
        with open(path, encoding="utf-8") as file:
            text = file.read()
        own = {name: value for name, value in frozen.items() if f'"{name}"' in text}
        total += margins(path, own, options.postures, options.near)
    print(f"\nviolations: {total}")
    raise SystemExit(total > 0)


if __name__ == "__main__":
    main()
