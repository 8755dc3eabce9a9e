"""The mass by each joint's equations: true gains agree, wrong ones are named."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.logs.torque_scale import TorqueScale
from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.studies.payload.doubts import disagreement, scale_sentence
from pivident.studies.payload.identify_payload import identify_payload
from pivident.studies.payload.joint_masses import JointMasses
from tests.load_scenario import LOAD, tx40_with_load
from tests.studies.payload.test_identify_payload import loaded

#: Declared over true torque of each joint.
OFF = np.array([1.0, 1.1, 1.0, 1.0, 0.9, 1.0])


def with_gains(arm, factors):
    """The same records by gains that are off."""
    empty, carrying = (
        replace(r, tau=r.tau * factors) for r in (*arm.problem.recordings, arm.loaded)
    )
    return replace(arm.problem, recordings=(empty,)), carrying


@pytest.fixture(scope="module")
def wrong():
    problem, carrying = with_gains(tx40_with_load(0, samples=9000), OFF)
    return identify_payload(problem, [carrying], "ls")


def test_true_gains_agree():
    """Chance alone: F is about one, and every mass is that of the load."""
    statistics, off = [], []
    for seed in range(30, 35):
        arm = tx40_with_load(seed, samples=5000)
        found = identify_payload(arm.problem, [arm.loaded], "ls")
        masses = found.masses
        assert not masses.disagree and masses.p_value > 1e-3
        assert masses.joints == arm.problem.robot.joint_names
        assert "The joints agree on the mass" in str(found)
        statistics.append(masses.statistic)
        np.testing.assert_allclose(masses.mass, LOAD.mass, rtol=0.05)
        mean = np.average(masses.mass, weights=masses.std**-2)  # least squares errs in common
        off.append((masses.mass - mean) / masses.std)
    assert 0.3 < np.mean(statistics) < 2.0
    assert np.abs(off).max() < 4.0 and 0.4 < np.sqrt(np.mean(np.square(off))) < 1.4


def test_two_gains_that_are_off_are_named_with_their_masses(wrong):
    masses, load = wrong.masses, wrong.load
    assert masses.disagree and masses.p_value < 1e-6
    np.testing.assert_allclose(masses.mass, OFF * LOAD.mass, rtol=0.02)
    assert np.abs((masses.mass - OFF * LOAD.mass) / masses.std).max() < 6.0
    assert masses.spread == pytest.approx(np.std(OFF, ddof=1), rel=0.25)
    (warning,) = [w for w in wrong.warnings if w.kind == "joints disagree"]
    assert "joint_2 1.10" in warning.message and "joint_5 0.90" in warning.message
    assert warning.message in str(wrong) and "joints agree" not in str(wrong)
    stored = wrong.account().values["masses"]
    assert stored["disagree"] and stored["joints"][1]["joint"] == "joint_2"
    # the interval without what the gains add would miss the truth
    assert abs(load.mass - LOAD.mass) < 2.0 * load.mass_std
    own = np.sqrt(load.mass_std**2 - masses.added[9, 9])
    assert abs(load.mass - LOAD.mass) > 2.0 * own


def test_an_error_that_all_gains_share_does_not_show():
    problem, carrying = with_gains(tx40_with_load(1, samples=5000), np.full(6, 1.1))
    found = identify_payload(problem, [carrying], "ls")
    assert not found.masses.disagree
    assert found.load.mass == pytest.approx(1.1 * LOAD.mass, rel=0.01)
    assert "an error of 1 % that all joints share is one of 1 % in the mass" in str(found)


def test_instruments_and_prefilters_agree_as_well():
    arm = tx40_with_load(0, samples=9000)
    found = identify_payload(arm.problem, [arm.loaded], "piv")
    assert not found.masses.disagree
    assert np.abs((found.masses.mass - LOAD.mass) / found.masses.std).max() < 4.5
    assert found.masses.std.min() < 0.002


def test_without_the_record_of_the_arm_no_joint_has_a_mass_of_its_own():
    arm = tx40_with_load(0, samples=5000)
    known = replace(identify(arm.problem, "ls"), equations=None)
    found = identify_payload(known, loaded(arm), "ls")
    assert found.masses is None and found.account().values["masses"] is None
    assert "The mass has the scale of the logged torque" in str(found)


def test_a_joint_behind_the_load_has_no_mass_of_its_own():
    arm = tx40_with_load(0, samples=5000)
    found = identify_payload(arm.problem, [arm.loaded], "ls", link="link_5")
    assert (
        {"joint_1", "joint_2", "joint_3"}
        <= set(found.masses.joints)
        <= {f"joint_{j}" for j in range(1, 6)}
    )


def test_the_scale_of_a_mass_without_torque_is_that_of_the_gains():
    q = np.sin(np.arange(100) / 10.0)[:, None]
    bare = Recording.from_arrays(q, None, 100.0)
    assert "the declared gains of the control law" in scale_sentence([bare])
    marked = replace(bare, torque_scale=(TorqueScale("joint_1", "output", "output"),))
    assert "ratio to the drive gain" in scale_sentence([marked])


def test_a_single_joint_that_is_off_disagrees_though_it_is_known_less_well():
    mass, std = np.array([2.0003, 2.0009, 2.24]), np.array([0.0014, 0.001, 0.023])
    masses = JointMasses(("a", "b", "z"), mass, std, 39.8, 5e-14, 0.005, np.zeros((10, 10)))
    assert masses.farthest == pytest.approx(0.12, abs=0.005) and masses.disagree
    (warning,) = disagreement(masses)
    assert "about 12 %" in warning.message
    near = replace(masses, mass=np.array([2.0003, 2.0009, 2.06]))
    assert near.farthest == 0.0 and not near.disagree
