"""What benchmarks/emps_black_box.py gives its models, and how it simulates them."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from benchmarks.emps_black_box import (
    LinearModel,
    Narx,
    Polynomials,
    Sampling,
    choose,
    errors,
    fitted,
    narx_models,
    repeated,
)
from benchmarks.open_loop_model import GIVEN, Stretch, rms

from pivident.data.recording.public_records import load_emps, load_emps_pulses
from pivident.data.recording.recording import Recording

RATE, SAMPLES = 1000.0, 4003
#: A carriage of 95 kg with 200 N s/m and no dry friction: its speed is of first order.
MASS, SLOPE = 95.0, 200.0


@pytest.fixture(scope="module")
def record():
    """Its motion under a force that is held, by the exact answer of each millisecond."""
    t = np.arange(SAMPLES) / RATE
    force = 30.0 * np.sin(2.0 * np.pi * 0.8 * t) + 20.0 * np.sign(np.sin(2.0 * np.pi * 0.31 * t))
    left, q, v = np.exp(-SLOPE / MASS / RATE), 0.05, 0.04
    positions = []
    for own in force:
        positions.append(q)
        end = own / SLOPE
        q += end / RATE + (v - end) * (1.0 - left) * MASS / SLOPE
        v = end + (v - end) * left
    return Recording(
        name="carriage", joint_names=("x",), rate=RATE, q=np.array(positions)[:, None],
        tau=force[:, None], torque_timing="held",
    )  # fmt: skip


@dataclass(frozen=True)
class FirstOrder:
    """A linear model of first order by least squares, its output shifted by ``wrong``."""

    sampling: Sampling
    wrong: float = 0.0
    title: str = "first order"
    names: tuple[str, ...] = ("a1", "b0", "b1")

    def fit(self, u, y):
        rows = np.stack([y[:-1], u[:-1], u[1:]], axis=1)
        a, b1, b0 = np.linalg.lstsq(rows, y[1:], rcond=None)[0]
        matrices = ([[a]], [[1.0]], [[b1 + a * b0]], [[b0]])
        own = tuple(np.array(m) for m in matrices)
        return LinearModel(own, (0.0, self.wrong), (1.0, 1.0))


@pytest.mark.parametrize("output", ["position", "speed"])
def test_outputs_give_the_positions_back(record, output):
    """The sum of mean speeds is exact at the ends of the intervals, a spline between them."""
    sampling, q = Sampling(output, 20, 2), record.q[:, 0]
    y = sampling.outputs(q, RATE)
    back = sampling.positions(y, q[0], RATE, SAMPLES)
    np.testing.assert_allclose(back[::20], q[::20], atol=1e-12)
    inside = slice(100, 3900)
    assert np.abs(back - q)[inside].max() < 1e-4


def test_inputs_are_means_over_the_intervals(record):
    u = Sampling("speed", 20, 2).inputs(record, Stretch(0, SAMPLES))
    assert len(u) == 201
    np.testing.assert_allclose(u[3], record.tau[60:80, 0].mean())
    np.testing.assert_allclose(u[-1], (record.tau[4000:, 0].sum() + 17 * record.tau[-1, 0]) / 20)


def test_a_model_of_the_right_order_predicts_motion_that_it_was_not_fitted_to(record):
    """Whatever is wrong with intervals, shifts or the start would be seen in free run."""
    structure = FirstOrder(Sampling("speed", 10, 2))
    model = fitted(structure, record, Stretch(0, 2000))
    left = errors(structure, model, record, Stretch(2000, SAMPLES))
    assert rms(left[GIVEN:]) < 0.2  # mm
    wrong = FirstOrder(Sampling("speed", 10, 2), wrong=0.01)
    assert (
        rms(errors(wrong, wrong.fit(*_data(wrong, record)), record, Stretch(2000, SAMPLES))) > 5.0
    )


def _data(structure, record):
    y = structure.sampling.outputs(record.q[:, 0], RATE)
    return structure.sampling.inputs(record, Stretch(0, SAMPLES))[: len(y)], y


def test_the_structure_with_the_smallest_held_out_error_is_chosen(record, capsys):
    tried = [FirstOrder(Sampling("speed", 10, 2), wrong) for wrong in (0.02, 0.0, 0.01)]
    assert choose("linear", tried, record)[0] is tried[1]
    assert "3 structures" in capsys.readouterr().out


@dataclass(frozen=True)
class Wandering(FirstOrder):
    """A model that is right of halves and wrong of longer records."""

    def fit(self, u, y):
        model = super().fit(u, y)
        return replace(model, means=(0.0, 0.02)) if len(y) > 300 else model


def test_a_structure_that_the_whole_record_does_not_bear_out_is_refused(record):
    wandering = Wandering(Sampling("speed", 10, 2))
    steady = FirstOrder(Sampling("speed", 20, 1))  # 1.5 mm on halves, 0.05 mm the other one
    assert choose("linear", [wandering, steady], record) == (steady, [wandering, steady])


def test_a_start_that_accelerates_was_at_its_speed_before():
    """Mean speeds over 10 ms of a start at 0.3 m/s with 2 m/s²."""
    y = Sampling("speed", 10, 2).around(np.array([1.0, 0.3, 7.0]), RATE)
    np.testing.assert_allclose(y, [0.3, 0.3, 0.3, 0.3, 0.31, 0.33])


def test_a_linear_model_starts_at_the_given_outputs():
    """Of second order two outputs are its state."""
    a, b, c = np.array([[1.6, -0.7], [1.0, 0.0]]), np.array([[1.0], [0.0]]), np.array([[0.3, 0.2]])
    model = LinearModel((a, b, c, np.array([[0.1]])), (2.0, 5.0), (3.0, 0.5))
    y = Sampling("position", 10, 2).around(np.array([0.0, 0.4, 4.9]), RATE)
    made = model.simulate(np.linspace(0.0, 4.0, 30), y, 0.0)
    np.testing.assert_allclose(made[:2], [4.9, 4.904], rtol=1e-12)


class Recursion:
    """y(k) = 0.5 y(k-1) + x(k-1), as the library simulates it."""

    def predict(self, X, y):
        made = [*y[:, 0]]
        for k in range(len(made), len(X)):
            made.append(0.5 * made[k - 1] + X[k - 1, 0])
        return np.array(made)[:, None]


@pytest.mark.parametrize(("ahead", "first"), [(True, 1.0), (False, 7.0)])
def test_a_mean_speed_answers_to_the_input_of_its_own_interval(ahead, first):
    """A position answers to the one before."""
    model = Polynomials(Recursion(), (1.0, 1.0), 2, ahead)
    made = model.simulate(np.array([1.0, 2.0, 3.0]), np.full(6, 4.0), 7.0)
    assert made[0] == 2.0 + first
    assert len(made) == 3


def test_no_narx_model_has_more_terms_than_its_polynomial():
    linear = [own for own in narx_models() if isinstance(own, Narx) and own.degree == 1]
    assert {own.terms for own in linear if own.lags == 1} == {2, 3}


@pytest.mark.record
def test_the_test_record_of_emps_repeats_the_training_motion(public_data):
    """To a tenth of a millimetre, less than any model scores: the page says so."""
    assert repeated(load_emps(), load_emps_pulses()) == pytest.approx(0.093, abs=5e-4)
