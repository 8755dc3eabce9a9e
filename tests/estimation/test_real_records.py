"""Published figures on the public records of the TX40 and of EMPS."""

import numpy as np
import pytest

from pivident.data.recording.public_records import load_emps, load_emps_pulses, load_staubli_tx40
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.identify import identify
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.friction import FrictionLaw, coulomb, offset, viscous
from pivident.robot.gallery import load_robot

pytestmark = pytest.mark.record

#: The laboratory's weighted least squares: value and printed relative deviation [%].
LABORATORY = {
    "zz1": (1.24, 1.11), "mx2": (2.22, 2.43), "my3": (-0.601, 2.11), "fv1": (8.05, 0.68),
    "fv2": (5.53, 1.04), "ia3": (0.0988, 7.21), "fc1": (7.14, 2.24), "fc2": (8.26, 1.69),
    "fv3": (1.97, 1.66), "off1": (0.392, 21.9), "off2": (1.37, 44.6), "fc3": (6.34, 1.71),
    "xx2": (-0.466, 2.59), "xx3": (0.127, 8.96), "ia4": (0.0313, 7.15), "xz2": (-0.160, 4.11),
    "zz3": (0.107, 8.17), "fv4": (1.11, 1.41), "zz2": (1.08, 1.01), "mx4": (-0.0219, 23.4),
    "fc4": (2.48, 2.29), "ia5": (0.0468, 7.90), "fv5": (1.86, 1.83), "fc5": (3.03, 2.95),
    "my5": (-0.0309, 12.6), "ia6": (0.0105, 11.9), "fv6": (0.650, 1.59), "fc6": (0.282, 28.8),
    "iam6": (0.00964, 13.0), "fvm6": (0.616, 1.61), "fcm6": (1.95, 3.47), "off3": (0.326, 63.0),
    "off4": (-0.102, 28.0),
}  # fmt: skip

LABORATORY_SIGNALS = Bandpass(cutoff=100.0, median=3, decimation=(10, 10), edge=20)


@pytest.fixture(scope="module")
def tx40(public_data):
    return load_staubli_tx40()


def test_tx40_weighted_least_squares_gives_the_laboratorys_table(tx40):
    law = FrictionLaw((viscous(), coulomb("sign"), offset()))
    robot = load_robot("staubli_tx40").with_friction(law)
    found = identify(Problem(robot, (tx40,)), LeastSquares(signals=LABORATORY_SIGNALS))
    assert found.theta.size == 61
    assert 100 * found.relative_error == pytest.approx(6.0, abs=0.2)
    for name, (value, relative) in LABORATORY.items():
        assert abs(found.value(name) - value) < abs(value) * relative / 100, name


def test_tx40_laboratorys_essential_parameters(tx40):
    law = FrictionLaw((viscous(), coulomb("sign"), offset()))
    robot = load_robot("staubli_tx40").with_friction(law)
    names = tuple(set(LABORATORY) - {"off1", "off2", "off3", "off4", "fc6"})
    full = identify(Problem(robot, (tx40,)), LeastSquares(signals=LABORATORY_SIGNALS))
    found = identify(
        Problem(robot, (tx40,), parameters=names), LeastSquares(signals=LABORATORY_SIGNALS)
    )
    weights = np.array([1.0 / j.noise_std**2 for j in full.joints])
    record = found.recordings[0]
    error = np.where(record.used, record.tau - record.tau_model, 0.0)
    torque = np.where(record.used, record.tau, 0.0)
    relative = np.sqrt((weights * error**2).sum() / (weights * torque**2).sum())
    assert 100 * relative == pytest.approx(6.2, abs=0.2)


@pytest.mark.parametrize("method", ["iv", "iv-full-rate", "piv"])
def test_tx40_without_its_reference_converges_from_cad_values(tx40, method):
    robot = load_robot("staubli_tx40")
    names = (*TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    record = tx40.slice(0.05, 7.5)
    loop = Loop(virtual_pd(robot, record.q.mean(axis=0)), reference="smoothed")
    found = identify(Problem(robot, (record,), loop, names), method)
    assert found.converged and found.iterations <= 8
    negative = [
        p.name
        for p, v in zip(found.parameters, found.theta, strict=True)
        if p.is_dissipative and v < 0
    ]
    assert not negative
    assert any("reference was not recorded" in w.message for w in found.warnings)


@pytest.fixture(scope="module")
def emps_loop():
    gain = 35.15065188248547
    controller = Cascade(np.array([160.18]), np.array([243.45]), averaged=True)
    return Loop(controller, gain, 10.0)


def test_emps_least_squares_gives_the_published_digits(public_data):
    law = FrictionLaw((viscous(), coulomb("sign"), offset()))
    robot = load_robot("emps").with_friction(law)
    signals = Bandpass(cutoff=100.0, padlen=12, decimation=10, edge=(49, 0))
    found = identify(Problem(robot, (load_emps(),), mask=None), LeastSquares(signals=signals))
    assert np.allclose(found.theta, [95.1089, 203.5034, 20.3935, -3.1648], atol=1e-4)


@pytest.mark.parametrize("method", ["iv", "iv-full-rate", "piv"])
def test_emps_predicts_the_unseen_pulses(public_data, emps_loop, method):
    robot = load_robot("emps")
    if method == "iv":
        method = InstrumentalVariables(signals=Bandpass(cutoff=100.0, decimation=10))
    found = identify(Problem(robot, (load_emps(),), emps_loop), method)
    assert found.converged and found.iterations <= 6
    pulses = load_emps_pulses()
    unseen = AuxiliaryModel(Problem(robot, (pulses,), emps_loop), differences=False)
    (motion,) = unseen.simulate(found.theta)
    error = np.linalg.norm(motion.tau[0] - pulses.tau[:, 0]) / np.linalg.norm(pulses.tau)
    assert 100 * error <= 5.85
    assert np.sqrt(np.mean((motion.q[0] - pulses.q[:, 0]) ** 2)) <= 2.6e-6
