"""IV and PIV without a control law, on records of the planar arm in a loop that they do not know.

Encoder noise goes through the law into the torque: least squares on smoothed positions is biased,
by as much in every record. What instruments are worth shows in the mean over records.
"""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identification_file import to_dict
from pivident.estimation.identify import identify
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass, RandomWalk
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.errors import SimulationDiverged
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.friction import FrictionLaw, coulomb, offset, viscous
from pivident.robot.gallery import load_robot
from tests.planar_arm import NAME, planar_record

RATE, PERIOD, REPEATED = 1000.0, 3000, 4

#: Differentiation that lets through the noise that the loop answers to.
WIDE = Bandpass(cutoff=120.0, bandwidth=100.0, align=True)

#: Runs of a Monte Carlo; their mean has a standard error of a third of one run's.
RUNS = 8


def smooth_friction_arm():
    """The planar arm with a sign that is smooth over the noise of the speeds.

    What a sharp one makes of noise, E f(dq + n) ≠ f(dq), no instrument corrects.
    """
    robot = load_robot(NAME)
    law = FrictionLaw((viscous(), coulomb(gamma=4.0), offset()))
    return replace(robot, joints=tuple(j.with_friction(law) for j in robot.joints))


def periodic_reference(rng):
    """Sums of sines of one period, from rest, repeated; shape (samples, joints)."""
    t = np.arange(REPEATED * PERIOD) / PERIOD
    q = np.zeros((t.size, 2))
    for harmonic in (1, 2, 3, 5, 8):
        phase, size = rng.uniform(0, 2 * np.pi, 2), rng.uniform(0.1, 0.5, 2) / harmonic
        q += size * (np.cos(2 * np.pi * harmonic * t[:, None] + phase) - np.cos(phase))
    return q


@pytest.fixture(scope="module")
def runs():
    """Records of one motion with different noise, and what they were made with."""
    robot = smooth_friction_arm()
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    theta[theta == 0.0] = 2.0
    reference = periodic_reference(np.random.default_rng(11))
    made = []
    for seed in range(RUNS):
        rng = np.random.default_rng(100 + seed)
        q, tau = planar_record(base, theta, reference, RATE, rng, encoder_noise=5e-5)
        tau += 0.05 * rng.standard_normal(tau.shape)
        made.append(Recording(f"run {seed}", ("shoulder", "elbow"), q, tau, RATE, q_ref=reference))
    return robot, theta, made


def errors(runs, method, **channels):
    """Errors over standard errors of each run, and errors, shape (runs, parameters)."""
    robot, theta, records = runs
    z, e = [], []
    for own in records:
        found = identify(Problem(robot, (replace(own, **channels),)), method)
        e.append(found.theta - theta)
        z.append(e[-1] / found.std)
    return np.array(z), np.array(e)


@pytest.mark.parametrize("kind", ["response", "repetition", "virtual"])
def test_instruments_without_a_law_remove_the_bias(runs, least_squares, kind):
    biased, uncertain = least_squares
    clear = np.abs(biased) > 6.0 * uncertain
    assert clear.sum() >= 4  # otherwise there is nothing to cure
    channels = {} if kind == "response" else {"q_ref": None}
    _, e = errors(runs, InstrumentalVariables(signals=WIDE, instruments=kind), **channels)
    mean, spread = e.mean(axis=0), e.std(axis=0, ddof=1) / np.sqrt(RUNS)
    assert (np.abs(mean)[clear] < np.abs(biased)[clear] / 3.0 + 2.5 * spread[clear]).all()


def test_a_second_sensor_removes_the_noise_of_the_first(runs):
    """Noise on the log alone: smoothed accelerations shrink what least squares makes of them."""
    robot, theta, records = runs
    base = base_parameters(robot)
    made = {"ls": [], "sensor": []}
    reference = records[0].q_ref
    for seed in range(RUNS):
        rng = np.random.default_rng(300 + seed)
        q, tau = planar_record(base, theta, reference, RATE, rng, encoder_noise=0.0)
        tau = tau + 0.05 * rng.standard_normal(tau.shape)
        dq = np.gradient(q, axis=0) * RATE + 2e-3 * rng.standard_normal(q.shape)
        noisy = q + 2e-5 * rng.standard_normal(q.shape)
        own = Recording("run", ("shoulder", "elbow"), noisy, tau, RATE, dq=dq)
        for name, method in {
            "ls": LeastSquares(signals=WIDE),
            "sensor": InstrumentalVariables(signals=WIDE, instruments="sensor"),
        }.items():
            found = identify(Problem(robot, (own,)), method)
            made[name].append(found.theta - theta)
    biased, left = (np.mean(made[name], axis=0) for name in ("ls", "sensor"))
    spread = {name: np.std(e, axis=0, ddof=1) / np.sqrt(RUNS) for name, e in made.items()}
    clear = np.abs(biased) > 6.0 * spread["ls"]
    assert clear.sum() >= 3
    assert (np.abs(left)[clear] < np.abs(biased)[clear] / 3.0 + 2.5 * spread["sensor"][clear]).all()


@pytest.fixture(scope="module")
def least_squares(runs):
    """Mean error of least squares over the runs, and its standard error."""
    _, e = errors(runs, LeastSquares(signals=WIDE))
    return e.mean(axis=0), e.std(axis=0, ddof=1) / np.sqrt(RUNS)


def test_piv_without_a_law_is_precise_and_knows_how_precise(runs):
    z, e = errors(runs, PrefilteredIV())
    _, plain = errors(runs, InstrumentalVariables(signals=RandomWalk()))
    assert np.mean(np.abs(z) < 1.96) > 0.8
    assert np.sqrt(np.mean(z**2)) < 1.6
    assert np.median(np.std(e, axis=0) / np.std(plain, axis=0)) < 0.5


def test_the_best_instruments_are_taken_first(runs):
    robot, own = runs[0], runs[2][0]
    kinds = {}
    for name, record in {
        "reference": own,
        "no reference": replace(own, q_ref=None),
        "once": replace(own, q_ref=None).part(0, 5000),
    }.items():
        found = identify(Problem(robot, (record,)), InstrumentalVariables(signals=RandomWalk()))
        kinds[name] = found.instruments
        assert found.method == f"IDIM-IV (full rate) ({found.instruments.kind})"
        assert found.loop is None
    assert kinds["reference"].kind == "response"
    assert "other repetitions" in kinds["reference"].others[0][0]
    assert kinds["no reference"].kind == "repetition"
    assert kinds["once"].kind == "virtual"


def test_decimated_iv_takes_the_same_instruments(runs):
    robot, own = runs[0], runs[2][0]
    found = identify(Problem(robot, (own,)), "iv")
    assert found.instruments.kind == "response" and found.is_decimated
    assert (np.abs(found.theta - runs[1]) < 5.0 * found.std).all()


def test_a_virtual_law_that_diverges_leaves_the_record(runs):
    robot, own = runs[0], runs[2][0]
    soft = Loop(PD([1e7, 1e7], [1e5, 1e5]), reference="smoothed")
    found = identify(Problem(robot, (own,), soft), "piv")
    assert found.instruments.kind == "response"
    assert "cannot make the instruments" in found.instruments.instead_of
    assert any(w.topic == "loop" for w in found.warnings)


def test_a_given_law_that_diverges_is_an_error(runs):
    robot, own = runs[0], runs[2][0]
    with pytest.raises(SimulationDiverged):
        identify(Problem(robot, (own,), Loop(PD([1e7, 1e7], [1e5, 1e5]))), "piv")


def test_the_instruments_are_stored(runs, tmp_path):
    robot, own = runs[0], runs[2][0]
    found = identify(Problem(robot, (own,)), "piv")
    found.save(tmp_path)
    loaded = load_identification(tmp_path)
    assert loaded.instruments == found.instruments
    assert loaded.method_used == found.method_used
    content = to_dict(found)
    assert content["instruments"]["kind"] == "response"
    assert len(content["instruments"]["agreement"]) == 2
