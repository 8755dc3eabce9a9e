"""Checks of a scenario before any simulation."""

from __future__ import annotations

import numpy as np

from pivident.errors import ExperimentError
from pivident.many.study.bench import Bench
from pivident.many.study.motion import reach_of
from pivident.many.study.scenario_tables import ScenarioTables
from pivident.robot.refusals import without_loops

#: Smallest number of samples of a record for all methods.
MIN_RECORD = 200

#: Largest number of samples of a record: two days at 5 kHz.
MAX_RECORD = 1_000_000_000


def check_scenario(scenario: ScenarioTables) -> None:
    """Refuse a scenario whose tables do not fit its robot."""
    without_loops(scenario.robot, "a study of simulated records", "use pivident.simulate")
    bench = Bench(scenario)
    scenario.methods, bench.estimated, bench.noise, bench.loop  # noqa: B018 - making them checks
    bench.controller.check(scenario.robot.size)
    _check_motion(scenario)


def _check_motion(scenario: ScenarioTables) -> None:
    entry, rate = scenario.content.trajectory, scenario.content.record.rate
    if entry.type != "fourier":
        reach_of(entry, scenario.robot.size)
    speeds = scenario.robot.rated_speeds
    if not np.isfinite(speeds).all():
        missing = scenario.robot.joint_names[int(np.flatnonzero(np.isnan(speeds))[0])]
        raise ExperimentError(
            f"[trajectory] the robot has no rated speed of joint {missing!r}, which the motion "
            "needs; add rated_speed to its description"
        )
    if entry.duration * rate > MAX_RECORD:
        raise ExperimentError(
            f"[trajectory] key 'duration' = {entry.duration:g} s gives a record of more than "
            f"{MAX_RECORD:,} samples at {rate:g} Hz; shorten it"
        )
    samples = round(entry.duration * rate)
    if samples < MIN_RECORD:
        raise ExperimentError(
            f"[trajectory] key 'duration' = {entry.duration:g} s gives a record of {samples} "
            f"samples at {rate:g} Hz; at least {MIN_RECORD} are needed"
        )
