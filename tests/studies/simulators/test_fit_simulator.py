"""Simulators fitted to positions that MuJoCo has made: the truth, held-out motion, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.studies.simulators.fit_simulator import fit_simulator


def test_intervals_cover_the_truth(leg):
    true = {
        "armature": leg.truth.ARMATURE,
        "damping": leg.truth.DAMPING,
        "frictionloss": leg.truth.FRICTIONLOSS,
        "bias": leg.truth.BIAS,
    }
    assert leg.fit.converged
    for quantity, values in true.items():
        for found, value in zip(leg.fit.of(quantity).values(), values, strict=True):
            assert abs(found.value - value) < 4 * found.std, found
            assert found.low < found.value < found.high
    assert abs(leg.fit.delay.value - leg.truth.DELAY) < 4 * leg.fit.delay.std
    assert leg.fit.delay.std < 0.1 / 200  # a tenth of a sample of the log


def test_standard_errors_are_small_because_encoders_are_fine(leg):
    assert all(v.std < 1e-3 * v.value for v in leg.fit.of("armature").values())
    count = leg.truth.COUNT / np.sqrt(12)
    assert (leg.fit.rms > 0.9 * count).all() and (leg.fit.rms < 2 * count).all()


def test_held_out_errors_shrink_to_counts(leg):
    rms = leg.judged.rms()
    assert (rms["before"] > 0.05).all()
    assert (rms["after"] < 3 * leg.truth.COUNT).all()
    assert (rms["after, 1 ms steps"] < 0.1 * rms["before"]).all()


def test_fitted_gains_are_found_where_inertias_are_known(leg):
    experiment = load_experiment(leg.folder / "leg.toml")
    recording = experiment.recordings()[0].part(0, 1600)
    wrong = Loop(PD(30.0, 1.2))
    free = ("damping", "frictionloss", "delay", "kp", "kd", "bias", "armature")
    fit = fit_simulator(experiment.robot, wrong, recording, free)
    assert fit.converged
    for found in fit.of("kp").values():
        assert abs(found.value - leg.truth.KP) < 5 * found.std
        assert found.start == 30.0
    np.testing.assert_allclose(fit.kp, leg.truth.KP, rtol=0.02)


def test_what_a_fit_cannot_use_is_refused(leg):
    experiment = load_experiment(leg.folder / "leg.toml")
    (recording,), robot = experiment.recordings(), experiment.robot
    law = Loop(PD(40.0, 1.0))
    with pytest.raises(ExperimentError, match="no reference"):
        fit_simulator(robot, law, replace(recording, q_ref=None))
    with pytest.raises(ExperimentError, match="free names 'mass'"):
        fit_simulator(robot, law, recording, ("mass",))
    with pytest.raises(ExperimentError, match="position gain of joint 'hip' is zero"):
        fit_simulator(robot, Loop(PD([40.0, 0.0, 40.0], 1.0)), recording)
    with pytest.raises(ExperimentError, match="no whole multiple"):
        fit_simulator(robot, law, replace(recording, control_rate=300.0))
    with pytest.raises(ExperimentError, match="too short for a warm-up"):
        fit_simulator(robot, law, recording.part(0, 100))
