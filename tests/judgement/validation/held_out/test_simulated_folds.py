"""Folds of fitted simulations: what is left out does not count, and what is left is fitted."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.output_error.loop_unknowns import with_values
from pivident.estimation.output_error.reduced_equations import bounded_step
from pivident.estimation.output_error.simulated_errors import simulated_errors
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.held_out.folds import (
    Fold,
    JudgedMotion,
    Piece,
    contiguous_folds,
    moving_part,
)
from pivident.judgement.validation.held_out.folds_from_rows import (
    _equations,
    rows_of,
    simulated_estimates_without,
)
from tests.planar_simulations import planar_problem, simulated_results


@pytest.fixture(scope="module")
def folds():
    motion = JudgedMotion.of(planar_problem())
    moving = [moving_part(motion.problem, judge.kinematics) for judge in motion.fitted]
    return contiguous_folds(motion.problem.recordings, moving, 4, 0.1)


def recordings(result):
    return [record.kinematics.recording for record in result.equations.records]


@pytest.mark.parametrize("name", ["cloe", "ml", "oloe"])
def test_the_simulation_of_a_fold_fits_what_is_left(folds, name):
    """Simulated anew with the fold's estimate, the remaining errors ask for no further step."""
    result = simulated_results()[name]
    fit = result.simulation.fit
    found = simulated_estimates_without(result, folds)
    left_out = rows_of(fit, recordings(result), folds[1])
    own = [p.value for p in found[1].simulation.loop_parameters]
    values = np.append(found[1].theta, own)
    stretches = [
        s.with_loop(with_values(s.loop, fit.unknowns, values - fit.values + _as_given(s.loop, fit)))
        for s in fit.stretches
    ]
    made = simulated_errors(stretches, fit.unknowns, fit.channels, fit.factors)
    kept = [
        replace(m, used=before.used & ~out, errors=m.errors - (shaken.errors - plain.errors))
        for m, before, out, shaken, plain in zip(
            made, fit.made, left_out, _simulated(fit), _left(fit), strict=True
        )
    ]
    equations = _equations(fit, kept, robust=False)
    unbounded = np.full(len(values), np.inf)
    held = fit.held | fit.bound
    step = bounded_step(equations.gram, equations.moment, -unbounded, unbounded, held).step
    std = np.where(held, 1.0, fit.std)
    assert np.abs(step / std).max() < 0.1
    moved = (values - fit.values) / std
    assert np.abs(moved).max() > 0.1  # the fold does make a difference


def _as_given(loop, fit):
    """Values by which ``with_values`` counts: offsets are counted from the loop itself."""
    return np.array([loop.value(u.direction) for u in fit.unknowns])


def _simulated(fit):
    """Errors at the estimate, simulated again."""
    return simulated_errors(fit.stretches, fit.unknowns, fit.channels, fit.factors)


def _left(fit):
    """The errors that the fit left: those, less the mean motion that noise in the loop adds."""
    return [replace(m, errors=e) for m, e in zip(fit.made, fit.errors, strict=True)]


@pytest.mark.parametrize("name", ["ml", "oloe"])
def test_errors_of_a_held_out_block_do_not_reach_its_estimate(folds, name):
    result = simulated_results()[name]
    fit = result.simulation.fit
    out = rows_of(fit, recordings(result), folds[2])
    changed = replace(
        result,
        simulation=replace(
            result.simulation,
            fit=replace(
                fit, errors=tuple(e + 1e3 * own for e, own in zip(fit.errors, out, strict=True))
            ),
        ),
    )
    before, after = (simulated_estimates_without(r, folds) for r in (result, changed))
    np.testing.assert_allclose(after[2].theta, before[2].theta, rtol=1e-12)
    assert np.abs(after[0].theta / before[0].theta - 1.0).max() > 1e-6


@pytest.mark.parametrize("name", ["cloe", "oloe"])
def test_rows_are_those_whose_means_see_a_left_out_sample(name):
    """By hand: row m averages samples 5 m … 5 m + 19 at 1 kHz, compared up to 100 Hz."""
    result = simulated_results()[name]
    fit = result.simulation.fit
    fold = Fold((), (Piece(0, 2200, 2300),))
    out = rows_of(fit, recordings(result), fold)
    seen = []
    for stretch, rows in zip(fit.stretches, out, strict=True):
        first = round(stretch.start_time * stretch.rate)
        seen += [first + 5 * m for m in np.flatnonzero(rows)]
    expected = [k for k in range(0, 6000, 5) if k < 2300 and k + 20 > 2200]
    assert set(seen) <= set(expected)
    assert len(expected) - len(seen) <= (0 if name == "cloe" else 4)  # ends of a stretch


def test_a_fold_of_everything_leaves_no_estimate():
    result = simulated_results()["cloe"]
    (made,) = simulated_estimates_without(result, [Fold((), (Piece(0, 0, 6000),))])
    assert isinstance(made, IdentificationError)
