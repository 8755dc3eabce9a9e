"""Binned maps: passes count, not samples."""

import numpy as np
import pytest

from pivident.studies.friction.friction_map import friction_map, friction_plane


def swept(passes, per_pass, rng, between=1.0):
    """A state swept up and down; each pass through its range has an error of its own."""
    up = np.linspace(0.0, 1.0, per_pass)
    state = np.concatenate([up if k % 2 == 0 else up[::-1] for k in range(passes)])
    errors = np.repeat(between * rng.standard_normal(passes), per_pass)
    return state, 2.0 + errors + 0.01 * rng.standard_normal(state.size)


def map_of(values, state, **options):
    return friction_map(
        values, state, name="position", unit="rad", used=np.ones(state.size, dtype=bool), **options
    )


def test_passes_are_counted():
    state, values = swept(10, 200, np.random.default_rng(0))
    found = map_of(values, state, bins=5, correlation=30.0)
    assert found.passes[1:4].tolist() == [10, 10, 10]
    assert found.samples.sum() == state.size
    np.testing.assert_allclose(found.effective[1:4], 10.0)
    # The turning bins are passed in pairs, without leaving them; the first also at both ends.
    assert found.passes[0] == 6 and found.passes[-1] == 5


def test_interval_covers_over_passes():
    inside = []
    for seed in range(200):
        state, values = swept(8, 60, np.random.default_rng(seed))
        found = map_of(values, state, bins=4, correlation=10.0)
        inside.append((found.lower[1] < 2.0) and (found.upper[1] > 2.0))
    assert 0.90 <= np.mean(inside) <= 0.99


def test_more_samples_of_the_same_passes_tell_no_more():
    widths = []
    for per_pass in (60, 600):
        state, _ = swept(8, per_pass, np.random.default_rng(1))
        found = map_of(np.repeat(np.arange(8.0), per_pass), state, bins=4, correlation=5.0)
        widths.append(found.upper[1] - found.lower[1])
    assert widths[0] == pytest.approx(widths[1], rel=1e-6)


def test_median_does_not_mind_one_wild_pass():
    state, values = swept(11, 100, np.random.default_rng(3), between=0.1)
    values[500:600] += 50.0
    mean = map_of(values, state, bins=4, correlation=10.0)
    median = map_of(values, state, bins=4, correlation=10.0, statistic="median")
    assert abs(median.value[1] - 2.0) < 0.2 < abs(mean.value[1] - 2.0)
    assert np.isfinite(median.upper[1])


def test_one_pass_has_no_interval():
    state = np.linspace(0, 1, 500)
    found = map_of(state, state, bins=5, correlation=1.0)
    assert np.isnan(found.lower).all() and (found.passes == 1).all()
    np.testing.assert_allclose(found.value, found.centre)
    pieces = map_of(state, state, bins=5, correlation=10.0, whole_passes=False)
    assert (pieces.passes >= 10).all() and np.isfinite(pieces.lower).all()


def test_record_ends_a_pass():
    state = np.full(100, 0.5)
    record = np.repeat([0, 1, 2, 3], 25)
    used = np.ones(100, dtype=bool)
    found = friction_map(
        record * 1.0, state, name="q", unit="rad", used=used, record=record, bins=3
    )
    assert found.passes.sum() == 4
    assert found.value[np.argmax(found.passes)] == pytest.approx(1.5)


def test_nothing_used_is_an_empty_map():
    found = friction_map(
        np.ones(10), np.ones(10), name="q", unit="rad", used=np.zeros(10, dtype=bool), bins=3
    )
    assert np.isnan(found.value).all() and found.samples.sum() == 0


def test_plane_shows_cells_with_two_passes_alone():
    rng = np.random.default_rng(4)
    t = np.arange(20000) / 500.0
    x, y = np.sin(2.1 * t), np.sin(1.3 * t + 1.0)
    values = 3.0 * x * y + 0.1 * rng.standard_normal(t.size)
    plane = friction_plane(
        values, x, y, used=np.ones(t.size, dtype=bool), correlation=5.0, bins=(6, 5)
    )
    assert plane.value.shape == (5, 6) and np.isfinite(plane.value).mean() > 0.8
    expected = 3.0 * plane.x * plane.y[:, None]
    assert np.nanmax(np.abs(plane.value - expected)) < 0.6
    assert np.isnan(plane.value[plane.effective < 2]).all()
