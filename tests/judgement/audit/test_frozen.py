"""Channels that keep a value for a while, and channels that only look like it."""

import numpy as np
import pytest

from pivident.data.logs.bad_samples import frozen_samples
from pivident.judgement.audit.audit import audit_log
from tests.judgement.audit.logs import planar, serious, with_torque

N = 6000
TIME = np.arange(N) / 500.0
Q = np.sin(2.0 * TIME) + 0.4 * np.sin(5.1 * TIME)
TORQUE = 8.0 * np.cos(2.0 * TIME) + 3.0 * np.tanh(20.0 * np.gradient(Q, TIME))


def noisy(seed, std=0.05):
    return TORQUE + std * np.random.default_rng(seed).standard_normal(N)


@pytest.mark.parametrize("length", [25, 60, 500, 2000])
@pytest.mark.parametrize("count", [0.0, 0.01])
def test_a_stretch_that_is_frozen_is_found(length, count):
    torque = noisy(length)
    if count:
        torque = count * np.round(torque / count)
    moving = 800 if length < 1000 else 1200
    torque[moving : moving + length] = torque[moving]
    frozen = np.flatnonzero(frozen_samples(torque, Q))
    assert abs(frozen[0] - moving) <= 1 and abs(frozen[-1] - (moving + length - 1)) <= 1
    assert frozen.size == frozen[-1] - frozen[0] + 1


def test_two_of_them_do_not_hide_each_other():
    torque = noisy(1)
    torque[500:700], torque[3000:3160] = torque[500], torque[3000]
    frozen = frozen_samples(torque, Q)
    assert frozen[500:700].all() and frozen[3000:3160].all() and frozen.sum() == 360


@pytest.mark.parametrize("count", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("std", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_coarse_channels_are_not_frozen(count, std, seed):
    assert not frozen_samples(count * np.round(noisy(seed, std) / count), Q).any()


@pytest.mark.parametrize("hold", [2, 10, 25, 100])
def test_a_slower_logger_is_not_frozen(hold):
    assert not frozen_samples(np.repeat(noisy(0)[::hold], hold), Q).any()


def test_a_joint_at_rest_may_keep_its_torque():
    still = np.where(TIME < 4.0, Q, Q[2000])
    assert not frozen_samples(np.where(TIME < 4.0, noisy(0), TORQUE[2000]), still).any()


def test_it_is_named_with_sample_and_time():
    def freeze(torque):
        torque = torque.copy()
        torque[300:420] = torque[300]
        return torque

    audit = audit_log(with_torque(planar(), 1, freeze))
    assert ("error", "frozen", "tau of elbow") in serious(audit)
    finding = next(f for f in audit.findings if f.kind == "frozen")
    assert finding.sample == 300 and "to 419 (" in finding.message
