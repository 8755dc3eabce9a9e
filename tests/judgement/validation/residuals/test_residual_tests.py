from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

import pivident as pv
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.signal_recipes import RandomWalk
from pivident.judgement.validation.residuals.autocorrelation import joint_residuals
from pivident.judgement.validation.residuals.cross_correlation import (
    Stretches,
    cross_correlation_test,
)
from pivident.judgement.validation.residuals.residual_tests import residual_tests
from pivident.loop.motion.motion import torque_of
from pivident.loop.simulation.controllers import PD
from pivident.robot.gallery import load_robot
from tests.planar_log import planar_log, planar_truth
from tests.synthetic_identification import synthetic_identification

# torque is not averaged over two periods here: noise of which that was done is no AR noise
SIGNALS = RandomWalk(align=False)
DIRECT = PrefilteredIV(signals=SIGNALS, prefilter="direct")


@cache
def exact_torque():
    """Torque that the smoothed motion explains exactly [N m], and the speeds [rad/s]."""
    given = problem(planar_log(2000)[:, 5:])
    kinematics = estimate_kinematics(given.recordings[0], SIGNALS)
    theta = np.array([planar_truth()[name] for name in given.names])
    return torque_of(given.regressor, kinematics, theta).T, kinematics.dq.T


def problem(tau):
    robot = load_robot("planar_2r")
    q, q_ref = np.deg2rad(planar_log(2000)[:, 1:3]), np.deg2rad(planar_log(2000)[:, 3:5])
    recording = pv.Recording("run", robot.joint_names, q, tau, 1000.0, q_ref=q_ref)
    loop = pv.Loop(PD([6000.0, 2500.0], [180.0, 60.0]))
    return pv.Problem(robot, (recording,), loop, initial=planar_truth())


def residuals_of(seed, std=0.3, unmodelled=0.0, method=DIRECT):
    tau, dq = exact_torque()
    fresh = std * np.random.default_rng(seed).standard_normal((2200, 2))
    noise = lfilter([1.0], [1.0, -1.2, 0.5], fresh, axis=0)[200:]
    stribeck = unmodelled * np.sign(dq) * np.exp(-((dq / 0.5) ** 2))
    return residual_tests(pv.identify(problem(tau + noise + stribeck), method))


@pytest.fixture(scope="module")
def under_the_null():
    return [residuals_of(seed) for seed in range(50)]


# 100 residuals at 5 %: 99.9 % of the counts of a right test are at most 13
@pytest.mark.parametrize("name", ["whiteness", "normality", "variance", "motion"])
def test_sizes_hold_for_the_residuals_of_piv(under_the_null, name):
    p = [test.p_value for found in under_the_null for _, test in found.of(name)]
    assert len(p) == 100
    assert np.count_nonzero(np.array(p) < 0.05) <= 13
    assert 0.38 < np.mean(p) < 0.62


def test_unmodelled_friction_is_found_in_the_motion(under_the_null):
    found = [residuals_of(seed, std=0.05, unmodelled=0.3) for seed in range(5)]
    assert all(f.worst("motion")[1].significant for f in found)
    assert not any(f.matters for f in under_the_null[:3])


def test_one_sentence_per_test_and_what_it_finds():
    identification = synthetic_identification(samples=4000)
    white = residual_tests(identification)
    assert [j.name for j in white.joints] == ["shoulder", "elbow"]
    assert white.joints[0].motion is None and white.worst("motion") is None
    assert len(white.summary) == 4 and not white.matters
    recording = identification.recordings[0]
    residual = recording.whitened.copy()
    residual[:, 1] = lfilter([1.0], [1.0, -0.6], residual[:, 1])
    residual[:200, 1] = np.nan
    recording = replace(recording, whitened=residual)
    found = residual_tests(replace(identification, recordings=(recording,)))
    assert found.matters and found.joints[1].samples == 3800
    assert found.worst("whiteness")[0] == "elbow"
    assert found.summary[0].startswith("The residual is correlated in time on elbow; worst elbow:")
    assert "elbow: Autocorrelation (Ljung-Box)" in str(found)


def test_the_order_of_the_noise_model_is_counted():
    residuals = joint_residuals(synthetic_identification())
    assert [r.order for r in residuals] == [20, 21]
    assert all(r.prefiltered and r.rate == 1000.0 for r in residuals)
    with_order_search = synthetic_identification(method_used=PrefilteredIV())
    assert joint_residuals(with_order_search)[0].penalty == 2.0
    assert joint_residuals(synthetic_identification())[0].penalty is None


def test_short_and_constant_residuals_are_named():
    identification = synthetic_identification()
    recording = identification.recordings[0]
    residual = recording.whitened.copy()
    residual[:, 0] = 1.0
    residual[100:, 1] = np.nan
    found = residual_tests(
        replace(identification, recordings=(replace(recording, whitened=residual),))
    )
    assert found.joints == () and found.untested == ("shoulder", "elbow")
    assert "Residuals of shoulder, elbow were not tested" in found.summary[-1]


def test_several_recordings_are_tested_as_one():
    identification = synthetic_identification()
    both = replace(identification, recordings=identification.recordings * 2)
    assert residual_tests(both).joints[0].samples == 4000


def test_errors_of_the_estimate_do_not_count_as_motion():
    rng = np.random.default_rng(0)
    z = np.cumsum(rng.standard_normal((3, 300)), axis=1)
    phi, white = z + 0.01 * rng.standard_normal(z.shape), rng.standard_normal(300)
    names, votes = ("zz1", "fv1", "fc1"), np.ones(300)
    plain = cross_correlation_test([Stretches(white, phi, z, votes)], names, 0.025)
    moved = cross_correlation_test([Stretches(white + 5 * phi[0], phi, z, votes)], names, 0.025)
    assert moved.statistic == pytest.approx(plain.statistic, rel=1e-6)
    late = white + 3.0 * np.r_[0.0, z[1, :-1]]
    found = cross_correlation_test([Stretches(late, phi, z, votes)], names, 0.025)
    assert found.matters and found.largest_column == "fv1"
    short = Stretches(white[:25], phi[:, :25], z[:, :25], votes[:25])
    assert cross_correlation_test([short], names, 0.025) is None
