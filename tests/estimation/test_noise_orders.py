"""The order of a noise model follows the length of the stretches that it is estimated on."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.estimation.full_rate import records_without_instruments
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Arma, AutoRegressive
from pivident.estimation.noise_identification import Whitening
from pivident.estimation.output_error.noise_weights import fitted_noise
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError
from pivident.signals.arma import arma
from pivident.signals.noise_models import continued_into_band, fit_ar
from tests.planar_simulations import planar_problem


def scene(noise):
    """Whitening of the planar record by a recipe, its records and a first estimate."""
    problem = planar_problem()
    method = PrefilteredIV(noise=noise, prefilter="direct")
    kinematics = [estimate_kinematics(r, RandomWalk()) for r in problem.recordings]
    limits = [problem.speed_limits(r) for r in problem.recordings]
    theta = identify(problem, LeastSquares(signals=RandomWalk())).theta
    records = records_without_instruments(kinematics, limits)
    return Whitening.of(problem, method, kinematics), records, theta


def broken(records, length, apart=20):
    """The same with stretches of at most so many samples in use."""
    own = []
    for record in records:
        used = record.used.copy()
        used[:, :: length + apart] = False
        for k in range(apart):
            used[:, k :: length + apart] = False
        own.append(replace(record, used=used))
    return own


def longest(used):
    edges = np.flatnonzero(np.diff(np.r_[False, used, False]))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def test_an_order_that_was_found_on_longer_stretches_falls():
    """Orders are decided in the first pass; later ones leave out other samples."""
    whitening, records, theta = scene(AutoRegressive(p_max=91))
    first = whitening.fitted(whitening.initial(), 1, theta, records)
    deepest = int(np.argmax(first.orders))
    length = 2 * first.orders[deepest] - 1  # a sample less than that order needs
    later = broken(records, length)
    second = whitening.fitted(first, 2, theta, later)
    carried = longest(later[0].used[deepest]) // 2
    assert second.orders[deepest] == min(first.orders[deepest], carried) < first.orders[deepest]
    names = whitening.problem.robot.joint_names
    (text,) = [
        w.message for w in whitening.warnings(second) if w.subject == names[deepest]
        and "falls" in w.message
    ]  # fmt: skip
    assert f"falls from {first.orders[deepest]} to {carried}" in text
    assert f"{longest(later[0].used[deepest])} samples" in text


def test_the_model_of_an_order_that_fell_is_that_of_this_order():
    whitening, records, theta = scene(AutoRegressive(p_max=40, motion_band=None))
    first = whitening.fitted(whitening.initial(), 1, theta, records)
    later = broken(records, 31)
    second = whitening.fitted(first, 2, theta, later)
    residual = _residual(whitening, records[0], theta)
    for j, model in enumerate(second.models):
        kin, order = records[0].kinematics, len(model.ar) - 1
        usable = slice(kin.start, kin.stop)
        # one sample of no recording follows, as recordings do not continue each other
        v = np.append(residual[j, usable], 0.0)
        mask = np.append(~later[0].used[j, usable], True)
        alone = continued_into_band(fit_ar(v, order=order, mask=mask), kin.recording.rate, 0.0)
        np.testing.assert_allclose(model.ar, alone.coefficients, rtol=1e-10)


def _residual(whitening, record, theta):
    from pivident.loop.motion.motion import residual_of

    return residual_of(whitening.problem.regressor, record.kinematics, theta)


@pytest.mark.parametrize("noise", [AutoRegressive(), Arma(8, 4)])
def test_stretches_too_short_for_any_model_are_taken_for_white(noise):
    whitening, records, theta = scene(noise)
    short = broken(records, 5)
    found = whitening.fitted(whitening.initial(), 1, theta, short)
    assert set(found.orders) == {0}
    said = [w.message for w in whitening.warnings(found)]
    assert len(said) == 2 and all("it is taken for white" in text for text in said)


def test_orders_of_a_moving_average_fall_to_what_the_stretches_carry():
    whitening, records, theta = scene(Arma(8, 4))
    found = whitening.fitted(whitening.initial(), 1, theta, broken(records, 30))
    for model in found.models:
        assert 1 < model.order <= 30 // 4 and len(model.ar) > 1 and len(model.ma) > 1
    assert all("falls from 12 to" in w.message for w in whitening.warnings(found))
    with pytest.raises(IdentificationError, match="lower the orders"):  # what it was asked for
        arma(np.random.default_rng(0).standard_normal(30), 8, 4)


def test_a_noise_model_with_a_moving_average_gives_its_innovations_back():
    """D v = C e: the prefilter D/C of the model makes e of v, for each joint."""
    whitening, (record,), theta = scene(Arma(2, 1))
    kinematics, rng = record.kinematics, np.random.default_rng(5)
    innovations = rng.standard_normal(kinematics.tau.shape)
    noise = lfilter([1.0, 0.7], [1.0, -1.2, 0.5], innovations)
    torque = kinematics.tau - _residual(whitening, record, theta) + noise
    record = replace(record, kinematics=replace(kinematics, tau=torque))
    found = whitening.fitted(whitening.initial(), 1, theta, [record])
    for j, prefilter in enumerate(found.filters):
        left = noise[j : j + 1].copy()
        prefilter.stream(1).process(left, left)
        settled = slice(200, None)
        assert np.std(left[0, settled] - innovations[j, settled]) < 0.1


def test_errors_of_a_simulation_in_short_stretches_are_weighted_by_their_size():
    errors = 3.0 * np.random.default_rng(1).standard_normal((2, 1, 400))
    used = np.ones((2, 1, 400), bool)
    used[1, :, ::6] = False
    found = fitted_noise([errors], [used], 100.0, 1, AutoRegressive(), 10.0)
    size = float(np.mean(errors[1, 0][used[1, 0]] ** 2))
    assert found.variance[1, 0] == pytest.approx(size)
    assert len(found.filters[1][0].fir) == 1
