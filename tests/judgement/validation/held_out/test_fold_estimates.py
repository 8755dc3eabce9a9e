"""Estimates from the sums of the other blocks against the stacked rows of these blocks, solved."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.experiment.simulated_tx40 import tx40_fine
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.held_out import fold_estimates
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.held_out.fold_estimates import estimates_without
from pivident.judgement.validation.held_out.folds import JudgedMotion, contiguous_folds
from pivident.robot.friction import FrictionLaw, coulomb, load_dependent, viscous
from tests.judgement.validation import one_axis as axis


@pytest.fixture(scope="module")
def problem():
    """Two recordings of six axes, so that a fold runs over the end of the first."""
    whole, _ = tx40_fine(seed=2, samples=14_000)
    (record,) = whole.recordings
    parts = record.part(0, 8_500), record.part(8_500, 14_000)
    return replace(whole, recordings=parts)


def solved_without(found, moving, fold):
    """Rows of all joints outside the fold, weighted and stacked, and their solution."""
    equations = found.equations
    regressor = equations.regressor
    rows, instruments, torque = [], [], []
    for number, record in enumerate(equations.records):
        at = record.sample_numbers
        kept = (at > moving[number][0] - 0.5) & (at < moving[number][1] - 0.5)
        for piece in fold.left_out:
            if piece.recording == number:
                kept &= (at < piece.start - 0.5) | (at > piece.stop - 0.5)
        for j in range(regressor.robot.size):
            own = regressor.columns_of(j)
            phi, z, tau = record.columns_of(regressor, equations.filters, j, np.arange(own.size))
            used = kept & record.used[j]
            weight = equations.variance[j] ** (-0.5 * equations.weight_power)
            for made, columns in ((rows, phi), (instruments, phi if z is None else z)):
                full = np.zeros((used.sum(), len(found.theta)))
                full[:, own] = weight * columns[:, used].T
                made.append(full)
            torque.append(weight * tau[used])
    phi, z, tau = np.vstack(rows), np.vstack(instruments), np.concatenate(torque)
    if not equations.has_instruments:
        return np.linalg.lstsq(phi, tau, rcond=None)[0]
    return np.linalg.solve(z.T @ phi, z.T @ tau)


@pytest.mark.parametrize("name", ["ls", "iv", "iv-full-rate", "piv", "piv-as-printed", "didim"])
def test_sums_without_a_fold_give_what_the_other_rows_give(problem, name):
    found, moving = identify(problem, METHODS[name]), JudgedMotion.of(problem).moving
    folds = contiguous_folds(problem.recordings, moving, 4, gap=0.05)
    assert len(folds[2].held_out) == 2
    made = estimates_without(found, moving, folds)
    for estimate, fold in zip(made, folds, strict=True):
        expected = solved_without(found, moving, fold)
        np.testing.assert_allclose(estimate.theta, expected, rtol=1e-6, atol=1e-7)
        assert np.abs(estimate.theta - found.theta).max() > 1e-5
        ratio = estimate.std / found.std
        assert (ratio > 1.0).all() and np.median(ratio) < 2.0  # a third of the rows is missing
        assert estimate.names == found.names and estimate.equations is None


def test_a_load_is_that_of_the_whole_record():
    """Friction that grows with the load: the whole estimate's load makes the columns."""
    motion = axis.problem(axis.recording(axis.motion()))
    law = FrictionLaw((viscous(), coulomb(), load_dependent()))
    joint = motion.robot.joints[0].with_friction(law)
    loaded = replace(motion, robot=replace(motion.robot, joints=(joint,)))
    assert loaded.regressor.depends_on_load
    found, moving = identify(loaded, "ls"), JudgedMotion.of(loaded).moving
    folds = contiguous_folds(loaded.recordings, moving, 3, gap=0.1)
    for estimate, fold in zip(estimates_without(found, moving, folds), folds, strict=True):
        expected = solved_without(found, moving, fold)
        np.testing.assert_allclose(estimate.theta, expected, rtol=1e-6)


def test_a_fold_without_which_a_joint_stands_still_has_no_estimate():
    """A motion in the first third only: without it nothing of the axis is left to fit."""
    made = axis.recording(axis.motion())
    still = np.repeat(made.q[1300:1301], 2700, axis=0)
    creep = 1e-6 * np.sin(20.0 * made.t[1300:])[:, None]  # moves, but slower than the mask
    q = np.vstack([made.q[:1300], still + creep])
    record = Recording("short", made.joint_names, q, made.tau, made.rate)
    motion = axis.problem(record, mask=0.01)
    found = identify(motion, "ls")
    folds = contiguous_folds(motion.recordings, [(0, 4000)], 3, gap=0.1)
    first, *others = estimates_without(found, [(0, 4000)], folds)
    assert isinstance(first, IdentificationError) and "usable rows" in str(first)
    assert not any(isinstance(other, IdentificationError) for other in others)


def test_a_fold_that_alone_shows_a_parameter_leaves_no_estimate():
    """The axis turns back within the second block only: dry friction and offset are one without."""
    t = np.arange(4000) / axis.RATE
    back = (t > 2.5) & (t < 3.5)
    speed = np.where(back, -1.0, 1.0) * (0.1 + 0.05 * np.sin(2.0 * np.pi * t))
    speed = np.convolve(speed, np.hanning(51) / np.hanning(51).sum(), mode="same")
    q = np.cumsum(speed)[:, None] / axis.RATE
    tau = 95.0 * np.gradient(speed)[:, None] * axis.RATE + 20.0 * np.sign(speed)[:, None]
    tau += np.random.default_rng(1).standard_normal(tau.shape)
    motion = axis.problem(Recording("once", ("carriage",), q, tau, axis.RATE), mask=0.0)
    found = identify(motion, "ls")
    folds = contiguous_folds(motion.recordings, [(0, 4000)], 4, gap=0.1)
    first, second, *others = estimates_without(found, [(0, 4000)], folds)
    assert isinstance(second, IdentificationError)
    assert "fc1" in str(second) and "off1" in str(second)
    assert not any(isinstance(other, IdentificationError) for other in (first, *others))


def test_a_fold_that_fails_is_kept_as_a_failure(problem, monkeypatch):
    calls, solve = [], fold_estimates.solve

    def failing(sums, variance, names):
        calls.append(sums)
        if len(calls) != 3:  # the first is that of the whole record
            return solve(sums, variance, names)
        raise IdentificationError("the motion is too poor")

    found = identify(problem, METHODS["iv-full-rate"])
    monkeypatch.setattr(fold_estimates, "solve", failing)
    result = cross_validate(problem, "iv-full-rate", folds=3, identification=found)
    assert len(result.failures) == 2 and "too poor" in str(result)  # both parts of the second fold
    assert sum(h.prediction is not None for h in result.held_out) == 2

    def always(sums, variance, names):
        raise IdentificationError("the motion is too poor")

    monkeypatch.setattr(fold_estimates, "solve", always)
    with pytest.raises(IdentificationError, match="the motion is too poor"):
        cross_validate(problem, "iv-full-rate", folds=3, identification=found)
