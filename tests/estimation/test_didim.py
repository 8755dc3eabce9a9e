"""DIDIM: the observation matrix from the simulated loop, on records with a coarse encoder."""

import dataclasses

import numpy as np
import pytest

from pivident.data.recording.public_records import load_emps
from pivident.estimation import auxiliary_model
from pivident.estimation.didim import Didim
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.loop.simulation.controllers import PD, Cascade
from pivident.robot.gallery import load_robot


def truth_of(problem, truth):
    return np.array([truth[p.name] for p in problem.regressor.parameters])


@pytest.fixture(scope="module")
def coarse():
    problem, truth = tx40_scenario("coarse", seed=2, samples=20000)
    return problem, truth_of(problem, truth)


@pytest.fixture(scope="module")
def found(coarse):
    return identify(coarse[0], "didim")


def test_a_coarse_encoder_costs_didim_next_to_nothing(coarse, found):
    problem, truth = coarse
    piv = identify(problem, "piv")
    error = [np.median(np.abs(r.theta / truth - 1.0)) for r in (found, piv)]
    assert found.converged and found.iterations <= 7
    assert error[0] < 3e-4  # as on the fine encoder
    assert error[0] < 0.1 * error[1]
    assert np.abs((found.theta - truth) / found.std).max() < 4.0
    assert np.mean(np.abs(found.theta - truth) < 2 * found.std) >= 0.8


def test_the_positions_of_the_record_do_not_reach_the_estimate(coarse, found):
    """Beyond the first samples, from which the loop starts and which it forgets."""
    problem, _ = coarse
    record = problem.recordings[0]
    q = record.q.copy()
    q[5000:] += 2e-4 * np.random.default_rng(0).standard_normal(q[5000:].shape)
    noisier = dataclasses.replace(problem, recordings=(dataclasses.replace(record, q=q),))
    again = identify(noisier, "didim")
    assert np.abs((again.theta - found.theta) / found.std).max() < 0.1


def test_samples_that_remember_the_start_do_not_vote(coarse, found):
    """The first position is known to within half a count, 10 N m at the controller's output."""
    problem, _ = coarse
    record = problem.recordings[0]
    assert found.recordings[0].t[0] > 0.05
    q = record.q.copy()
    q[:40] += 2 * np.pi / 3600  # one count off
    shifted = dataclasses.replace(problem, recordings=(dataclasses.replace(record, q=q),))
    again = identify(shifted, "didim")
    assert np.abs((again.theta - found.theta) / found.std).max() < 0.3


def test_a_loop_that_does_not_forget_is_refused(coarse, monkeypatch):
    monkeypatch.setattr(auxiliary_model, "FORGOTTEN", -1.0)
    with pytest.raises(IdentificationError, match=r"coarse-2.*more than half the record.*piv"):
        identify(coarse[0], "didim")


def test_measured_positions_that_know_better_are_named(coarse, found):
    assert not [w for w in found.warnings if "further from the measured" in w.message]
    problem, _ = tx40_scenario("fine", seed=2, samples=20000)
    law = problem.loop.controller
    loop = Loop(PD(1.1 * np.asarray(law.kp), law.kd))
    wrong = identify(dataclasses.replace(problem, loop=loop), "didim")
    (said,) = [w.message for w in wrong.warnings if "further from the measured" in w.message]
    assert "joint_2" in said


def test_a_virtual_loop_is_refused(coarse):
    problem, _ = coarse
    q = problem.recordings[0].q
    loop = Loop(virtual_pd(problem.robot, q.mean(axis=0)), reference="smoothed")
    with pytest.raises(ExperimentError, match="use piv"):
        identify(dataclasses.replace(problem, loop=loop), "didim")


def test_options_that_contradict_each_other_are_refused():
    with pytest.raises(ExperimentError, match="as_printed"):
        Didim(as_printed=True)
    with pytest.raises(ExperimentError, match="simulated loop: choose 'loop'"):
        Didim(instruments="sensor")
    assert METHODS["didim"].label == "DIDIM (prefiltered)"


@pytest.mark.record
def test_emps_rounded_to_half_a_millimetre_gives_what_its_own_encoder_gives(public_data):
    """The real drive's encoder resolves 50 nm; model error is not taken for noise."""
    robot, record = load_robot("emps"), load_emps()
    controller = Cascade(np.array([160.18]), np.array([243.45]), averaged=True)
    loop = Loop(controller, 35.15065188248547, 10.0)
    rounded = dataclasses.replace(record, q=5e-4 * np.round(record.q / 5e-4))
    fine = identify(Problem(robot, (record,), loop), "piv")
    coarse = identify(Problem(robot, (rounded,), loop), "didim")
    assert coarse.converged
    assert np.abs((coarse.theta - fine.theta) / fine.std).max() < 0.7
    assert coarse.loop is loop
