"""Memory of a fit of simulations over the length of its record, and where its derivatives lie."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.output_error import simulated_errors
from pivident.estimation.output_error.fit import FitOptions, fit_simulation
from pivident.estimation.output_error.simulated_errors import JoinedColumns, KeptColumns
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES
from tests.estimation.output_error.arms import loop, stretch, unknowns
from tests.planar_arm import nominal_parameters

#: All samples are rows, so that derivatives are as long as the record.
EVERY_SAMPLE = FitOptions(channels=(POSITIONS, TORQUES), bandwidth=0.0, covariance="sandwich")


def planar_stretch(samples: int):
    _, theta = nominal_parameters()
    own = stretch(loop(1.05 * theta, samples=samples), noise=1e-5)
    return replace(own, loop=loop(1.05 * theta, samples=samples))


def peak_of_fit(samples: int) -> int:
    """Bytes that a fit takes beside its record."""
    own, sought = planar_stretch(samples), unknowns()
    tracemalloc.start()
    try:
        fit_simulation([own], sought, EVERY_SAMPLE)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_derivatives(monkeypatch):
    monkeypatch.setattr(simulated_errors, "IN_MEMORY", 2**16)
    peak_of_fit(2000)  # compiled, tables made
    shorter, longer = (peak_of_fit(samples) for samples in (4000, 8000))
    record = 4000 * 4 * 8  # bytes of the positions and torques that the longer one has more
    assert longer - shorter < 8 * record


@pytest.mark.parametrize("in_memory", [0, 2**24])
def test_estimates_do_not_depend_on_where_derivatives_lie(monkeypatch, in_memory):
    own, sought = planar_stretch(3000), unknowns()
    whole = fit_simulation([own], sought, EVERY_SAMPLE)
    monkeypatch.setattr(simulated_errors, "IN_MEMORY", in_memory)
    kept = fit_simulation([own], sought, EVERY_SAMPLE)
    np.testing.assert_array_equal(kept.values, whole.values)
    np.testing.assert_array_equal(kept.covariance, whole.covariance)


@pytest.mark.parametrize("lengths", [(1, 7, 30, 2, 24), (64,), (32, 32)])
def test_blocks_are_the_rows_that_were_added(monkeypatch, lengths):
    monkeypatch.setattr(simulated_errors, "ROWS", 16)
    rng = np.random.default_rng(1)
    rows, total = rng.normal(size=(sum(lengths), 2, 3, 4)), sum(lengths)
    first, last = KeptColumns(2, 3, 3, total, 2000), KeptColumns(2, 3, 1, total, 0)
    for part in np.split(rows, np.cumsum(lengths)[:-1]):
        first.add(part[..., :3])
        last.add(part[..., 3:])
    joined = JoinedColumns(first, last, 2)
    assert (first.count, joined.count) == (3, 4)
    for c, j in np.ndindex(2, 3):
        for span, block in joined.blocks(c, j):
            assert span.stop - span.start == block.shape[1] <= 16
            np.testing.assert_array_equal(block, rows[span, c, j][:, [0, 1, 3, 2]].T)
        assert span.stop == total
