"""The cause of a simulation that diverges is the one that was put in."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import PividentError
from pivident.judgement.diagnostics.failed_simulation import identify
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario import read_scenario
from tests.judgement.validation.test_missing_inertia import ARM


@pytest.fixture(scope="module")
def fine():
    return Bench(read_scenario(ARM, "arm")).problem(0)


FROM_INITIAL = InstrumentalVariables(RandomWalk(), start="initial")


def noted(problem, method=FROM_INITIAL):
    with pytest.raises(PividentError) as caught:
        identify(problem, method)
    return " ".join(caught.value.__notes__)


def test_rotors(fine):
    robot = replace(fine.robot, rotor_inertia=np.zeros(2))
    assert noted(replace(fine, robot=robot, initial={})).startswith("With the rotor inertia of")


def test_the_sign_of_the_torque(fine):
    turned = replace(fine.loop, drive_gain=-1.0)
    assert "other sign" in noted(replace(fine, loop=turned))


def test_gains_in_the_wrong_unit(fine):
    law = fine.loop.controller
    degrees = replace(fine.loop, controller=type(law)(law.kp * 57.3, law.kd * 57.3))
    text = noted(replace(fine, loop=degrees), "piv")
    assert "0.0175 times as large" in text and "N m per rad" in text


def test_a_log_that_is_slower_than_the_controller(fine):
    slow = tuple(
        replace(r, q=r.q[::10], tau=r.tau[::10], q_ref=r.q_ref[::10],
                dq_ref=None, ddq_ref=None, rate=r.rate / 10, control_rate=r.rate / 10)
        for r in fine.recordings
    )  # fmt: skip
    assert "control rate of" in noted(replace(fine, recordings=slow), "piv")


def test_nominal_inertias_that_are_far_off(fine):
    far = replace(fine, initial={"zz1r": 1e-3, "ia2": 1e-4})
    assert "estimate of least squares" in noted(far) or "rotor inertia" in noted(far)


def test_what_the_log_lacks_is_told_beside_it(fine):
    """An audit knows that samples are missing where the loop cannot be simulated."""
    rng = np.random.default_rng(0)
    turned = replace(fine.loop, drive_gain=-1.0)
    gaps = []
    for r in fine.recordings:
        kept = np.sort(rng.permutation(r.samples)[: int(0.99 * r.samples)])
        channels = {name: getattr(r, name)[kept] for name in ("q", "tau", "q_ref", "dq_ref")}
        gaps.append(replace(r, **channels, ddq_ref=None))
    text = noted(replace(fine, loop=turned, recordings=tuple(gaps)), "piv")
    assert "missing from the log" in text
    assert "missing from the log" not in noted(replace(fine, loop=turned), "piv")
