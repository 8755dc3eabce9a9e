"""Two implementations of the paper's method, written apart, on records of the twin."""

import numpy as np
import pytest

from tests.independent.identification import prefiltered
from tests.independent.loop import simulated
from tests.independent.twin import AS_PIVIDENT, bench_of, twin


@pytest.fixture(scope="module")
def motor():
    return bench_of("motor")


def test_both_loops_move_alike(motor):
    made = twin(motor, 0)
    q, dq, _, tau = simulated(made.record, made.truth)
    np.testing.assert_allclose(q, motor.noise_free.q, atol=1e-6)
    np.testing.assert_allclose(dq, motor.noise_free.dq, atol=1e-4)
    np.testing.assert_allclose(tau, motor.noise_free.tau, atol=2e-3)


@pytest.mark.parametrize("run", [0, 5])  # in record 5 the first estimate has friction that drives
def test_both_agree_within_a_twentieth_of_a_standard_error(motor, run):
    made = twin(motor, run)
    ours, second = made.by_pivident(), prefiltered(made.record, AS_PIVIDENT, made.start)
    assert ours.converged and second.converged
    assert np.max(np.abs(ours.theta - second.theta) / second.errors) < 0.05
    np.testing.assert_allclose(second.errors, ours.errors, rtol=0.01)


def test_neither_gives_an_estimate_where_the_encoders_count_revolutions_of_the_joint():
    made = twin(bench_of("joint"), 0)
    ours, second = made.by_pivident(), prefiltered(made.record, AS_PIVIDENT, made.start)
    assert "mass matrix is not positive definite" in ours.end
    assert "runs away" in second.end
