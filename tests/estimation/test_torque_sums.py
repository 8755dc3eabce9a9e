"""Torque errors from sums against torque errors from signals; hostile values."""

import json

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor import Regressor
from pivident.estimation.identification import estimated_in_base, torque_sums
from pivident.estimation.solved_equations import TorqueSums
from pivident.foundation.codec import decode
from pivident.foundation.text.plain_values import plain
from tests.synthetic_identification import synthetic_identification


def weighted_error(identification, base, values):
    """‖τ - Φβ‖/‖τ‖ from the signals, joints weighted by their rms error."""
    regressor = Regressor.build(base.robot, base.parameters)
    rms = np.array([j.rms_error for j in identification.joints])
    error = total = 0.0
    for r in identification.recordings:
        tau = np.where(r.used, r.tau, 0.0) / rms
        model = np.where(r.used, regressor.torque(r.q, r.dq, r.ddq, values), 0.0) / rms
        error += np.sum((tau - model) ** 2)
        total += np.sum(tau**2)
    return np.sqrt(error / total)


@pytest.mark.parametrize("robot", ["planar_2r", "staubli_tx40"])
def test_sums_give_the_error_that_signals_give(robot):
    free = synthetic_identification(robot_name=robot)
    # the residual of the fit is that of its own parameters
    regressor = Regressor.build(free.robot, free.parameters)
    (r,) = free.recordings
    object.__setattr__(r, "tau_model", regressor.torque(r.q, r.dq, r.ddq, free.theta))
    base = base_parameters(free.robot)
    sums = torque_sums(free)
    values = estimated_in_base(free, base)
    assert sums.relative_error(values) == pytest.approx(weighted_error(free, base, values))
    other = values * np.random.default_rng(0).normal(1.0, 0.1, values.size)
    assert sums.relative_error(other) == pytest.approx(weighted_error(free, base, other))
    assert sums.rows == np.count_nonzero(r.used)


def read(values, found):
    return decode(TorqueSums, values, **{"base parameters": len(base_parameters(found.robot))})


def test_there_and_back():
    free = synthetic_identification()
    base, sums = base_parameters(free.robot), torque_sums(free)
    again = read(json.loads(json.dumps(plain(sums), allow_nan=False)), free)
    assert np.array_equal(again.gram, sums.gram)
    assert again.relative_error(np.ones(len(base))) == sums.relative_error(np.ones(len(base)))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("gram", [1.0]),
        ("moment", "x"),
        ("square", float("nan")),
        ("square", -1.0),
        ("rows", None),
    ],
)
def test_values_that_are_not_sums_are_refused(key, value):
    free = synthetic_identification()
    values = plain(torque_sums(free)) | {key: value}
    with pytest.raises(ValueError, match=key):
        read(values, free)


def test_an_indefinite_gram_matrix_is_refused():
    free = synthetic_identification()
    values = plain(torque_sums(free))
    values["gram"][0] *= -1.0
    with pytest.raises(ValueError, match="semidefinite"):
        read(values, free)


def test_without_signals_the_next_step_is_said():
    with pytest.raises(ValueError, match="identify again"):
        torque_sums(synthetic_identification(recordings=()))
