"""The Monte Carlo example, on processes: coverage, and an error of a run that names its joint."""

from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from importlib import import_module
from multiprocessing import get_context

import numpy as np
import pytest

import pivident as pv
from pivident.foundation.errors import SimulationDiverged
from tests.conftest import REPOSITORY


@pytest.fixture(scope="module")
def pool():
    """One process for all that is run elsewhere: each would import the libraries for seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(REPOSITORY / "examples" / "python"))
        with ProcessPoolExecutor(1, get_context("spawn")) as made:
            yield made


@pytest.fixture
def example(pool, monkeypatch):
    """The example with that process in place of as many as there are processors."""

    def kept(mp_context):
        assert mp_context.get_start_method() == "spawn"
        return nullcontext(pool)

    example = import_module("monte_carlo")
    monkeypatch.setattr(example, "ProcessPoolExecutor", kept)
    return example


def test_intervals_hold_the_truth_as_often_as_they_say(example):
    """650 intervals: standard errors of 0.75 or 1.25 times their size would leave the bounds."""
    duration = 3.0
    assert 0.90 < example.coverage(range(50), duration) < 0.98
    few = [example.held(seed, duration, 0.95) for seed in range(4)]
    assert example.coverage(range(4), duration) == np.mean(few)  # the same in other processes
    narrow = [example.held(seed, duration, 0.5) for seed in range(4)]
    assert np.mean(narrow) < np.mean(few)


def unstable(seed):
    """A run in a loop whose drive has the wrong sign."""
    robot = pv.load_robot("planar_2r")
    loop = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]), drive_gain=[-1.0, 1.0])
    return pv.simulate(robot, loop, duration=2.0, seed=seed)


def test_a_failing_run_names_its_joint_and_the_pool_lives_on(pool):
    with pytest.raises(SimulationDiverged, match="joint 'shoulder'") as caught:
        pool.submit(unstable, 0).result(timeout=120)
    assert caught.value.joint == "shoulder" and caught.value.advice
    assert pool.submit(abs, -1).result(timeout=120) == 1
