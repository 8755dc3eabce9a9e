"""The Monte Carlo example, on processes: coverage, and an error of a run that names its joint."""

from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from multiprocessing import get_context

import pytest

import pivident as pv
from pivident.foundation.errors import SimulationDiverged
from tests.conftest import REPOSITORY


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(REPOSITORY / "examples" / "python"))
    return import_module("monte_carlo")


def test_intervals_hold_the_truth_as_often_as_they_say(example):
    seeds, duration = range(6), 3.0
    found = example.coverage(seeds, duration)
    serial = [example.held(seed, duration, 0.95) for seed in seeds]
    assert found == sum(map(sum, serial)) / sum(map(len, serial))  # the same in other processes
    assert 0.85 < found <= 1.0
    assert example.coverage(seeds, duration, level=0.5) < found


def unstable(seed):
    """A run in a loop whose drive has the wrong sign."""
    robot = pv.load_robot("planar_2r")
    loop = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]), drive_gain=[-1.0, 1.0])
    return pv.simulate(robot, loop, duration=2.0, seed=seed)


def test_a_failing_run_names_its_joint_and_the_pool_lives_on():
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        with pytest.raises(SimulationDiverged, match="joint 'shoulder'") as caught:
            pool.submit(unstable, 0).result(timeout=120)
        assert caught.value.joint == "shoulder" and caught.value.advice
        assert pool.submit(abs, -1).result(timeout=120) == 1
