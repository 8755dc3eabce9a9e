import dataclasses
import json

import numpy as np
import pytest

from pivident.foundation.errors import NonFiniteSamples, RecordingError
from pivident.signals.random_walk import EDGE, irwsm, smooth_channels
from pivident.signals.random_walk_model import nvr_from_f50
from tests.signals.motions import RATE, point_to_point

COARSE = 2 * np.pi / 3600


@pytest.fixture(scope="module")
def motion():
    return point_to_point()


def error_of(result, ddq):
    inner = slice(300, -300)
    return np.sqrt(np.mean((result.ddq - ddq)[inner] ** 2))


def test_third_order_has_far_better_accelerations_than_the_papers_second(motion):
    q, ddq = motion
    y = np.round(q / COARSE) * COARSE
    second, third = irwsm(y, RATE, 2), irwsm(y, RATE, 3)
    assert error_of(third, ddq) < error_of(second, ddq) / 3
    assert third.log_likelihood > second.log_likelihood + 100


def test_quantisation_is_recognised_as_noise_of_a_twelfth_of_a_square_count(motion):
    q, _ = motion
    result = irwsm(np.round(q / COARSE) * COARSE, RATE)
    assert result.noise_std == pytest.approx(COARSE / np.sqrt(12), rel=0.1)
    assert not result.on_bound
    assert 10 < result.f50 < 40


def test_the_second_pass_changes_next_to_nothing(motion):
    q, ddq = motion
    y = np.round(q / COARSE) * COARSE
    once, twice = irwsm(y, RATE, 2), irwsm(y, RATE, 2, passes=2)
    assert error_of(twice, ddq) == pytest.approx(error_of(once, ddq), rel=0.01)
    np.testing.assert_array_equal(once.q, twice.q)


def test_derivatives_are_recentred():
    t = np.arange(2000) / RATE
    result = irwsm(np.sin(2 * np.pi * 10 * t), RATE, nvr=1e2)
    inner = slice(EDGE, -EDGE)
    w = 2 * np.pi * 10
    np.testing.assert_allclose(result.dq[inner], w * np.cos(w * t)[inner], atol=1e-3 * w)
    np.testing.assert_allclose(result.ddq[inner], -(w**2) * np.sin(w * t)[inner], atol=1e-3 * w**2)


def test_channels_are_independent_of_each_other_and_of_the_threads(motion):
    q, _ = motion
    rng = np.random.default_rng(0)
    y = q[:6000, None] * [1.0, -0.3, 2.0] + [1e-3, 1e-4, 1e-5] * rng.standard_normal((6000, 3))
    whole = irwsm(y, RATE)
    single = smooth_channels(y, RATE, threads=1)
    for index in range(3):
        alone = irwsm(y[:, index], RATE)
        assert alone.q.shape == (6000,)
        for name, value in vars(alone).items():
            np.testing.assert_array_equal(value, vars(whole.channel(index))[name])
            np.testing.assert_array_equal(value, vars(single.channel(index))[name])
    assert whole.nvr.shape == whole.ddq_noise.shape == (3,)


def test_given_ratios_are_used_channel_by_channel(motion):
    q, _ = motion
    y = np.column_stack([q, q])[:3000]
    result = irwsm(y, RATE, nvr=[1e-6, 1e-8])
    np.testing.assert_array_equal(result.nvr, [1e-6, 1e-8])
    assert not result.on_bound.any()
    assert np.isnan(result.log_nvr_std).all()


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_a_constant_channel_comes_back_unchanged(offset):
    result = irwsm(np.full(1000, offset), RATE)
    np.testing.assert_allclose(result.q, offset, atol=1e-12)
    np.testing.assert_array_equal(result.ddq, 0.0)
    assert result.on_bound
    assert result.noise_std == 0


def test_a_noiseless_trajectory_passes(motion):
    q, ddq = motion
    result = irwsm(q, RATE)
    np.testing.assert_allclose(result.q, q, atol=1e-9)
    assert error_of(result, ddq) < 1e-2
    assert result.noise_std < 1e-9


def test_a_cap_holds_and_is_reported(motion):
    q, _ = motion
    y = np.round(q / 3.5e-6) * 3.5e-6
    result = irwsm(y, RATE, f50_max=40.0)
    assert result.on_bound
    assert result.f50 == pytest.approx(40.0, rel=1e-2)
    assert "on a bound" in result.advice(5.0)[0]


def test_advice_compares_the_bandwidth_with_the_motion(motion):
    q, _ = motion
    result = irwsm(q, RATE, nvr=nvr_from_f50(20, 3, RATE))
    assert "keeps the motion up to 5 Hz" in result.advice(5.0)[0]
    assert "damps the motion up to 10 Hz" in result.advice(10.0)[0]


def test_edge_grows_with_the_memory_of_the_smoother(motion):
    q, _ = motion
    assert irwsm(q, RATE, nvr=nvr_from_f50(100, 3, RATE)).edge == EDGE
    assert irwsm(q, RATE, nvr=nvr_from_f50(10, 3, RATE)).edge == 80


def test_too_narrow_a_smoother_is_refused_with_advice(motion):
    q, _ = motion
    with pytest.raises(RecordingError, match="decimate the record first"):
        irwsm(q, RATE, nvr=1e-16)


@pytest.mark.parametrize(
    ("samples", "options"), [(10, {}), (100, {"order": 5}), (100, {"passes": 3})]
)
def test_what_cannot_be_smoothed_is_refused(samples, options):
    with pytest.raises(RecordingError):
        irwsm(np.arange(float(samples)), RATE, **options)


def test_missing_samples_are_reported_with_their_place():
    y = np.random.default_rng(0).standard_normal((100, 2))
    y[17:19, 1] = np.nan
    with pytest.raises(NonFiniteSamples) as caught:
        irwsm(y, RATE)
    assert (caught.value.joint, caught.value.sample, caught.value.count) == ("1", 17, 2)


def test_results_are_frozen(motion):
    result = irwsm(motion[0][:1000], RATE)
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.order = 2


@pytest.mark.record
def test_encoder_noise_of_the_simulated_record_is_found(reference_dir):
    q = np.load(reference_dir / "tx40_simulated_record.npz")["q"]
    facts = json.loads((reference_dir / "tx40_simulated_record.json").read_text())
    result = irwsm(q, facts["rate_hz"])
    assert not result.on_bound.any()
    np.testing.assert_allclose(result.noise_std, facts["encoder_noise_std_rad"], rtol=0.03)
