"""Design a motion, record it, identify, and design the next one after the result.

A planar arm beside a rack, simulated: its frictions are not those of its description. The first
design assumes the noise; the second knows it from the first result, and adds what that lacks.

    python design_and_record.py [--folder FOLDER] [--seconds SECONDS]
"""

import argparse
from pathlib import Path

import numpy as np

import pivident as pv
from pivident.experiment.excite_keys import ExciteEntry
from pivident.loop import virtual_pd
from pivident.studies import (
    Design,
    DesignRequest,
    clearances_of_room,
    design_motion,
    joint_limits,
    write_design,
)

#: What the machine has instead of its description's frictions [N m s/rad, N m].
TRUTH = {"fv1": 3.4, "fc1": 5.5, "fv2": 0.8, "fc2": 2.7}

#: The forearm, which has no known shape, and the rack [m].
ROOM = {
    "body": [
        {"name": "tube", "link": "forearm", "from": [0, 0, 0], "to": [0.3, 0, 0], "radius": 0.04}
    ],
    "obstacle": [{"name": "rack", "shape": "box", "size": [0.3, 0.2, 0.4], "at": [-0.65, 0.45, 0]}],
}


def record(design: Design, loop: pv.Loop, seed: int) -> pv.Recording:
    """The record of a motion, as the machine would write it."""
    reference = design.motion.sampled(1000.0)[0]
    made = pv.simulate(
        design.robot, loop, reference, values=TRUTH, encoder=2e-6, torque=0.1, seed=seed
    )
    return made.recording


def main(folder: Path, seconds: float = 5.0) -> list[np.ndarray]:
    """Run the example.

    Args:
        folder: for the files of both designs.
        seconds: for each search.

    Returns:
        Standard errors that PIV reports after one record and after both.
    """
    robot = pv.load_robot("planar_2r")
    loop = pv.Loop(virtual_pd(robot, np.zeros(robot.size)))
    room = clearances_of_room(robot, ExciteEntry.model_validate(ROOM))
    request = DesignRequest(duration=8.0, criterion="worst", seconds=seconds)
    results: list[pv.Identification] = []
    recordings: list[pv.Recording] = []
    for number in (1, 2):
        design = design_motion(
            robot, request, limits=joint_limits(robot), after=results[::-1][:1], clearances=room
        )
        write_design(design, folder / f"motion-{number}")
        nearest = design.clearances[0]
        print(f"motion {number}: {nearest.name} come as near as {1e3 * nearest.least:.0f} mm")
        recordings.append(record(design, loop, number))
        result = pv.identify(pv.Problem(robot, tuple(recordings), loop), "piv")
        results.append(result)
        predicted = {p.name: p.std for p in design.predicted}
        print(f"{'parameter':9s} {'value':>9s} {'σ predicted':>12s} {'σ reached':>10s}")
        for name, value, std in zip(result.names, result.theta, result.std, strict=True):
            print(f"{name:9s} {value:9.4f} {predicted[name]:12.2g} {std:10.2g}")
    return [result.std for result in results]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("."))
    parser.add_argument("--seconds", type=float, default=5.0)
    main(**vars(parser.parse_args()))
