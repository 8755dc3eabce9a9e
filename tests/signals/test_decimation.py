import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import decimate

from pivident.foundation.errors import RecordingError, RecordingTooShort
from pivident.signals.decimation import (
    decimation_blocks,
    decimation_offsets,
    decimation_overlap,
    decimation_stages,
    fewest_samples,
    parallel_decimation,
)


@pytest.mark.parametrize(
    ("factor", "stages"),
    [
        (1, ()),
        (10, (10,)),
        (12, (12,)),
        (20, (5, 4)),
        (34, (17, 2)),
        (100, (10, 10)),
        (125, (5, 5, 5)),
        (250, (10, 5, 5)),
    ],
)
def test_factors_are_split_into_stages(factor, stages):
    assert decimation_stages(factor) == stages


@given(st.integers(1, 3000))
def test_stages_multiply_to_the_factor(factor):
    stages = decimation_stages(factor)
    assert math.prod(stages) == factor
    assert all(s <= 13 or all(s % d for d in range(2, s)) for s in stages)


def test_a_factor_that_leaves_nothing_is_refused_at_once():
    with pytest.raises(RecordingError, match="leaves nothing"):
        decimation_stages(2**61 - 1)


def test_the_papers_record_keeps_276_rows():
    assert parallel_decimation(np.zeros((34_500, 2)), 125).shape == (276, 2)


def test_scipys_convention_is_scipys_decimate_ends_included():
    x = np.random.default_rng(0).standard_normal(8001)
    ours = parallel_decimation(x, (5, 4), convention="scipy")
    np.testing.assert_allclose(ours, decimate(decimate(x, 5), 4), atol=1e-9)


@given(st.integers(20_000, 20_200), st.sampled_from([2, 5, 10, 20, 100]))
@settings(max_examples=25, deadline=None)
def test_rows_stand_on_the_samples_that_the_convention_names(samples, factor):
    """A slow straight line passes with the gain of a constant, so rows tell their instants."""
    t = np.arange(samples) - samples / 2
    for convention in ("matlab", "scipy"):
        rows = parallel_decimation(
            np.column_stack([t, np.ones(samples)]), factor, convention=convention
        )
        instants = rows[:, 0] / rows[:, 1] + samples / 2
        first, scale = 0, 1
        stages = decimation_stages(factor)
        for stage, offset in zip(
            stages, decimation_offsets(samples, stages, convention), strict=True
        ):
            first, scale = first + scale * offset, scale * stage
        expected = first + factor * np.arange(len(rows))
        middle = slice(len(rows) // 3, -len(rows) // 3)
        np.testing.assert_allclose(instants[middle], expected[middle], atol=0.05)
        if convention == "matlab":
            assert expected[-1] == samples - 1


def test_matlabs_convention_keeps_the_last_sample():
    assert decimation_offsets(24_792, 10) == (1,)
    assert decimation_offsets(34_500, 125) == (4, 4, 4)
    assert decimation_offsets(34_500, 125, "scipy") == (0, 0, 0)


@given(
    st.integers(600, 60_000),
    st.sampled_from([(4,), (10,), (5, 4), (10, 10)]),
    st.integers(100, 20_000),
    st.sampled_from(["matlab", "scipy"]),
)
@settings(max_examples=30, deadline=None)
def test_overlapping_blocks_give_the_whole(samples, stages, block, convention):
    if samples // math.prod(stages[:-1]) <= 27:
        return
    x = np.random.default_rng(0).standard_normal((samples, 2)) + 10
    whole = parallel_decimation(x, stages, convention=convention)
    assembled = np.full_like(whole, np.nan)
    for part in decimation_blocks(samples, stages, block, convention):
        rows = parallel_decimation(
            x[part.source], stages, convention=convention, offsets=part.offsets
        )
        assembled[part.target] = rows[part.keep]
    np.testing.assert_allclose(assembled, whole, atol=2e-11)


def test_overlap_is_in_samples_of_the_record():
    one = decimation_overlap(10)
    assert decimation_overlap(100) == one + 10 * one
    assert decimation_overlap(1) == 0


def test_all_columns_pass_the_same_filter():
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((3000, 4))
    parameters = rng.standard_normal(4)
    left = parallel_decimation(columns, 10) @ parameters
    np.testing.assert_allclose(left, parallel_decimation(columns @ parameters, 10), atol=1e-12)


@pytest.mark.parametrize("factor", [0, -3])
def test_factors_below_one_are_refused(factor):
    with pytest.raises(RecordingError, match="one or more"):
        parallel_decimation(np.zeros(100), factor)


def test_too_short_a_record_is_refused():
    with pytest.raises(RecordingTooShort, match="at least"):
        parallel_decimation(np.zeros(200), 100)


@pytest.mark.parametrize("convention", ["matlab", "scipy"])
@pytest.mark.parametrize("factor", [1, 4, 25, (10, 10), (5, 4)])
def test_the_filters_have_enough_of_the_fewest_samples(factor, convention):
    fewest = fewest_samples(factor, convention)
    assert len(parallel_decimation(np.ones((fewest, 1)), factor, convention=convention))
    if factor != 1:
        with pytest.raises(RecordingTooShort):
            parallel_decimation(np.ones((fewest - 1, 1)), factor, convention=convention)
