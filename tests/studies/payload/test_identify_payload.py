"""The load on a simulated TX40: recovered within its intervals, and what can go wrong."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identification_file import save_identification
from pivident.estimation.identify import identify
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.errors import (
    ExperimentError,
    IdentificationError,
    NegativePayload,
    RobotDescriptionError,
)
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.studies.payload.arm_and_load import KnownParts, load_columns
from pivident.studies.payload.identify_payload import identify_payload
from tests.load_scenario import LOAD, tx40_with_load

SAMPLES = 6000
TRUE = LOAD.known()


def shortened(recording, samples, step=1):
    signals = {
        name: getattr(recording, name)[:samples:step]
        for name in ("q", "tau", "q_ref", "dq_ref", "ddq_ref")
    }
    rate = recording.rate
    return replace(recording, **signals, rate=rate / step, control_rate=rate)


@pytest.fixture(scope="module")
def arm():
    return tx40_with_load(0, samples=SAMPLES)


@pytest.fixture(scope="module")
def empty(arm):
    return identify(arm.problem, "piv")


@pytest.fixture(scope="module")
def found(arm, empty):
    return identify_payload(empty, loaded(arm))


def loaded(arm, recording=None):
    return replace(arm.problem, recordings=(recording or arm.loaded,))


def deviations(load) -> np.ndarray:
    return (load.values - TRUE) / load.std


def test_the_load_is_recovered_within_its_intervals(found):
    load = found.load
    assert found.converged and not found.warnings and load.rank == 10 and load.is_possible
    assert np.abs(deviations(load)).max() < 4.0
    assert load.mass == pytest.approx(1.0, abs=0.005) and load.mass_std < 0.002
    np.testing.assert_allclose(load.center_of_mass, LOAD.center_of_mass, atol=1e-3)
    np.testing.assert_allclose(load.inertia, LOAD.inertia, atol=5e-4)
    assert np.abs((load.inertia - LOAD.inertia) / load.inertia_std).max() < 4.0
    assert np.abs(found.arm_change).max() < 4.5


def test_it_agrees_with_the_generalised_least_squares_of_the_difference(arm, empty, found):
    """Two estimates of all base parameters say the same of the load as one that shares the arm."""
    second = identify(loaded(arm), "piv")
    friction = np.eye(len(empty.theta))[:, [not p.carries_load for p in empty.parameters]]
    design = np.hstack([load_columns(arm.problem.base, 5), friction])
    weight = np.linalg.inv(empty.formula_covariance + second.formula_covariance)
    root = np.linalg.cholesky(weight).T
    difference = np.linalg.lstsq(root @ design, root @ (second.theta - empty.theta), rcond=None)[0]
    assert np.abs((difference[:10] - found.load.values) / found.load.std).max() < 0.5


def test_an_arm_from_its_file_serves_as_well(arm, empty, found, tmp_path):
    save_identification(empty, tmp_path)
    again = identify_payload(load_identification(tmp_path), loaded(arm))
    np.testing.assert_allclose(again.load.values, found.load.values, rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(again.load.std, found.load.std, rtol=1e-6)


@pytest.mark.parametrize("method", ["ls", "iv"])
def test_the_other_estimators_agree(arm, found, method):
    other = identify_payload(arm.problem, [arm.loaded], method)
    assert other.method == {"ls": "IDIM-WLS", "iv": "IDIM-IV (full rate)"}[method]
    assert np.abs(deviations(other.load)).max() < 4.5
    assert np.median(other.load.std / found.load.std) > 1.0


def test_intervals_cover_the_truth():
    inside, off = [], []
    for seed in range(20, 26):
        arm = tx40_with_load(seed, samples=5000)
        load = identify_payload(arm.problem, [arm.loaded], "ls").load
        centre = np.abs(load.center_of_mass - LOAD.center_of_mass) < 2 * load.center_of_mass_std
        inertia = np.abs(load.inertia - LOAD.inertia) < 2 * load.inertia_std
        inside.append([*(np.abs(deviations(load)) < 2.0), *centre, *inertia])
        off.append(deviations(load))
    assert np.mean(inside) >= 0.85
    # and they are no wider than the errors make them: deviations of 1 in the root mean square
    assert 0.65 <= np.sqrt(np.mean(np.square(off))) <= 1.5


def test_a_short_loaded_record_is_enough_and_a_shorter_one_says_less(arm, empty, found):
    one = identify_payload(empty, loaded(arm, shortened(arm.loaded, 3000))).load
    half = identify_payload(empty, loaded(arm, shortened(arm.loaded, 1500))).load
    for load in (one, half):
        assert np.abs(deviations(load)).max() < 4.0
    assert found.load.mass_std < one.mass_std < half.mass_std < 0.05


def test_another_rate_is_no_matter(arm, empty):
    load = identify_payload(empty, loaded(arm, shortened(arm.loaded, SAMPLES, 2))).load
    assert np.abs(deviations(load)).max() < 4.0


def test_swapped_records_are_told(arm):
    problem = replace(arm.problem, recordings=(arm.loaded,))
    with pytest.raises(NegativePayload, match="Swap the two records") as caught:
        identify_payload(problem, arm.problem.recordings, "ls")
    assert caught.value.mass == pytest.approx(-1.0, abs=0.02)


def test_no_load_is_told(arm, empty):
    other = tx40_with_load(3, samples=SAMPLES)
    found = identify_payload(empty, loaded(arm, other.problem.recordings[0]), "ls")
    assert not found.load.is_seen
    assert "No load is seen" in found.warnings[0].message and "No load is seen" in str(found)
    assert not np.isfinite(found.load.fieller_interval()).any()


def test_known_parts_hold_and_narrow_the_rest(arm, empty, found):
    known = KnownParts(mass=1.0, center_of_mass=LOAD.center_of_mass)
    load = identify_payload(empty, loaded(arm), known=known).load
    assert load.mass == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(load.center_of_mass, LOAD.center_of_mass, atol=1e-6)
    assert (load.std <= found.load.std * 1.001).all() and np.abs(deviations(load)[:6]).max() < 4.0
    # a scale that errs is not believed more than its deviation says
    doubted = identify_payload(empty, loaded(arm), known=KnownParts(mass=1.01, mass_std=0.05)).load
    assert doubted.mass == pytest.approx(found.load.mass, abs=1e-4)


def test_a_drawing_that_is_off_by_its_own_deviation_does_no_harm(arm, empty, found):
    off = np.add(LOAD.center_of_mass, (0.005, -0.005, 0.005))
    known = KnownParts(center_of_mass=tuple(off), center_of_mass_std=0.005, inertia=LOAD.inertia)
    load = identify_payload(empty, loaded(arm), "ls", known=known).load
    assert np.abs(deviations(load)).max() < 4.0
    assert np.abs((load.center_of_mass - LOAD.center_of_mass) / load.center_of_mass_std).max() < 4.0
    assert load.mass_std < 0.01 and load.center_of_mass_std.max() < 1e-3


@pytest.mark.parametrize("mass", [0.2, 5.0])
def test_a_known_centre_counts_as_much_as_it_is_known_whatever_the_mass_is(empty, mass):
    """The intervals are those of Bayes with the centre as a prior."""
    body = replace(LOAD, mass=mass, inertia=tuple(mass * np.array(LOAD.inertia)))
    short = tx40_with_load(0, samples=SAMPLES, load=body)
    problem = loaded(short, shortened(short.loaded, 3000))
    free = identify_payload(empty, problem, "ls").load
    gradient = np.zeros((3, 10))
    gradient[:, 6:9], gradient[:, 9] = np.eye(3) / mass, -np.array(LOAD.center_of_mass) / mass
    spread = gradient @ free.covariance @ gradient.T
    prior = float(np.median(np.sqrt(np.diag(spread))))
    known = KnownParts(center_of_mass=LOAD.center_of_mass, center_of_mass_std=prior)
    load = identify_payload(empty, problem, "ls", known=known).load
    posterior = np.linalg.inv(np.linalg.inv(spread) + np.eye(3) / prior**2)
    np.testing.assert_allclose(load.center_of_mass_std, np.sqrt(np.diag(posterior)), rtol=0.15)


def test_an_arm_with_a_singular_covariance_is_refused(arm, empty):
    n = len(empty.theta)
    copied = np.array(empty.formula_covariance)
    copied[1], copied[:, 1] = copied[0], copied[:, 0]
    copied[1, 1] = copied[0, 1] = copied[1, 0] = copied[0, 0]
    for covariance, said in (
        (copied, f"{empty.names[0]}|{empty.names[1]}"),
        (np.zeros((n, n)), "no standard error"),
        (np.full((n, n), np.nan), "no standard error"),
    ):
        broken = replace(empty, formula_covariance=covariance)
        with pytest.raises(IdentificationError, match=said):
            identify_payload(broken, loaded(arm), "ls")


def test_known_parts_and_results_share_the_frame_of_the_tool(arm, empty, found):
    pose = Pose(rotation_from_rpy(0.1, 0.2, -0.4), np.array([0.0, 0.01, 0.065]))
    centre = pose.rotation.T @ (np.array(LOAD.center_of_mass) - pose.translation)
    plain = identify_payload(empty, loaded(arm), "ls", frame=pose).load
    link = identify_payload(empty, loaded(arm), "ls").load
    np.testing.assert_allclose(plain.values, link.seen_from(pose, "").values, atol=1e-12)
    assert "tool with origin (0, 0.01, 0.065) m" in plain.frame
    known = KnownParts(center_of_mass=tuple(centre))
    held = identify_payload(empty, loaded(arm), "ls", known=known, frame=pose).load
    np.testing.assert_allclose(held.center_of_mass, centre, atol=1e-6)
    assert held.mass_std < link.mass_std


def test_friction_under_load_is_not_taken_for_a_load(arm, empty):
    rough = tx40_with_load(0, samples=SAMPLES, friction_factor=1.3)
    free = identify_payload(empty, loaded(arm, rough.loaded), "ls")
    assert np.abs(deviations(free.load)).max() < 4.5
    assert "Friction that differs with the load: fv1 +" in str(free)
    shared = identify_payload(arm.problem, [rough.loaded], "ls", friction_under_load=False)
    assert abs(shared.load.mass - 1.0) > 20.0 * free.load.mass_std
    assert any("A load does not explain all" in warning.message for warning in shared.warnings)


def test_a_load_on_another_link_does_not_fit(arm):
    found = identify_payload(arm.problem, [arm.loaded], "ls", link="link_5")
    assert found.link == "link_5" and found.joint == "joint_5"
    (warning,) = [w for w in found.warnings if w.kind == "does not explain"]
    assert "joint_5" in warning.message and "the link that carries it" in warning.next_step


def test_what_does_not_belong_together_is_refused(arm, empty):
    problem = loaded(arm)
    with pytest.raises(RobotDescriptionError, match="did you mean 'link_6'"):
        identify_payload(empty, problem, link="link_66")
    turned = replace(problem, robot=problem.robot.with_gravity(np.array([0.0, 9.81, 0.0])))
    with pytest.raises(ExperimentError, match="another mounting"):
        identify_payload(empty, turned)
    with pytest.raises(ExperimentError, match="both without and with"):
        identify_payload(arm.problem, arm.problem)
    with pytest.raises(ExperimentError, match="no recording with the load"):
        identify_payload(arm.problem, [])
    with pytest.raises(ExperimentError, match="as a Problem"):
        identify_payload(empty, [arm.loaded])
    for method in ("didim", "piv-as-printed", "ols"):
        with pytest.raises(ExperimentError):
            identify_payload(empty, problem, method)
