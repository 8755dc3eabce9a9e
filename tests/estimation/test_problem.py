"""What a problem refuses, and what it says."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.method import AutoRegressive
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import (
    ExperimentError,
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    RecordingError,
    RecordingTooShort,
    SimulationDiverged,
)
from pivident.judgement.diagnostics.failed_simulation import identify
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.description import Link
from pivident.robot.gallery import load_robot
from tests.planar_log import write_experiment

RATE = 1000.0


@pytest.fixture(scope="module")
def arm():
    return load_robot("planar_2r")


def record_of(arm, samples=4000, still=None, **changes):
    rng = np.random.default_rng(8)
    postures = rng.uniform(-1.0, 1.0, (20, arm.size))
    if still is not None:
        postures[:, still] = 0.0
    q, dq, ddq = point_to_point(postures, np.full(arm.size, 3.0), RATE, samples)
    noise = 1e-6 * rng.standard_normal(q.shape)
    tau = 5.0 * np.sin(q) + dq + ddq + 1e-3 * rng.standard_normal(q.shape)
    fields = {"q_ref": q, "dq_ref": dq} | changes
    return Recording("run", arm.joint_names, q + noise, tau, RATE, **fields)


@pytest.fixture(scope="module")
def record(arm):
    return record_of(arm)


def loop_of(arm, kp=400.0, kd=40.0, gain=1.0):
    return Loop(PD(np.full(arm.size, kp), np.full(arm.size, kd)), gain)


def test_an_unknown_parameter_brings_the_nearest_name(arm, record):
    with pytest.raises(ExperimentError, match=r"'fv3'.*fv"):
        Problem(arm, (record,), parameters=("zz1", "fv3"))


def test_a_parameter_asked_for_twice_is_refused(arm, record):
    with pytest.raises(ExperimentError, match="twice"):
        Problem(arm, (record,), parameters=("fv1", "fv1"))


def test_initial_values_need_known_names(arm, record):
    with pytest.raises(ExperimentError, match="fc9"):
        Problem(arm, (record,), initial={"fc9": 1.0})


def test_joints_of_record_and_robot_must_match(record):
    with pytest.raises(ExperimentError, match=r"2 joints.*6"):
        Problem(load_robot("staubli_tx40"), (record,))


def test_no_recording_is_refused(arm):
    with pytest.raises(IdentificationError, match="at least one"):
        Problem(arm, ())


def test_gains_need_one_value_per_joint(arm, record):
    with pytest.raises(ExperimentError, match="kp"):
        Problem(arm, (record,), Loop(PD(np.ones(3), np.ones(3))))


@pytest.mark.parametrize("mask", [-0.1, 1.0, 7])
def test_a_mask_is_a_share_of_the_rated_speed(arm, record, mask):
    with pytest.raises(ExperimentError, match="share"):
        Problem(arm, (record,), mask=mask)


def test_the_simulated_loop_cannot_be_asked_for_where_there_is_none(arm, record):
    with pytest.raises(ExperimentError, match=r"\[controller\]"):
        identify(Problem(arm, (record,)), InstrumentalVariables(instruments="loop"))
    with pytest.raises(ExperimentError, match="prefilter"):
        identify(Problem(arm, (record,)), PrefilteredIV(prefilter="controller"))


def test_a_recorded_reference_must_be_there(arm):
    record = record_of(arm, q_ref=None, dq_ref=None)
    with pytest.raises(ExperimentError, match="smoothed"):
        identify(Problem(arm, (record,), loop_of(arm)), "piv")


def test_an_unknown_method_lists_the_known_ones(arm, record):
    with pytest.raises(IdentificationError, match="piv"):
        identify(Problem(arm, (record,)), "kalman")


def test_a_loop_that_cannot_be_simulated_names_joint_and_time(arm, record):
    with pytest.raises((SimulationDiverged, MassMatrixNotPositiveDefinite)) as caught:
        identify(Problem(arm, (record,), loop_of(arm, gain=-1.0)), "iv-full-rate")
    assert caught.value.joint in arm.joint_names
    assert "s (" in str(caught.value)


def test_a_joint_that_rests_costs_its_friction_and_its_rotor(arm):
    record = record_of(arm, still=1, allow_constant=True)
    still = np.zeros_like(record.q)
    still[:, 0] = record.q[:, 0]
    record = Recording("run", arm.joint_names, still, record.tau, RATE, allow_constant=True)
    found = identify(Problem(arm, (record,), mask=None), "ls")
    (warning,) = [warning for warning in found.warnings if warning.kind == "inseparable"]
    assert warning.subject == "ia2, fv2, fc2" and not {"ia2", "fv2", "fc2"} & set(found.names)


def test_a_masked_joint_without_rows_is_named(arm):
    record = record_of(arm)
    with pytest.raises(IdentificationError, match="low-speed mask"):
        identify(Problem(arm, (record,), mask=0.999), "ls")


@pytest.mark.parametrize("options", [{"tolerance": 0.0}, {"max_iterations": 0}])
def test_iteration_options_are_checked(options):
    with pytest.raises(ExperimentError):
        InstrumentalVariables(**options)
    with pytest.raises(ExperimentError):
        PrefilteredIV(**options)


def test_an_unknown_prefilter_is_refused():
    with pytest.raises(ExperimentError, match="direct"):
        PrefilteredIV(prefilter="sideways")


def test_the_motions_band_is_a_number_none_or_that_of_an_arm(record):
    assert AutoRegressive().band(record) == 20.0
    assert AutoRegressive(motion_band=None).band(record) == 0.0
    assert AutoRegressive(motion_band=5.0).band(record) == 5.0


def test_degrees_taken_for_radians_are_refused(arm):
    record = record_of(arm)
    fields = {"q_ref": record.q_ref}
    degrees = Recording("run", arm.joint_names, np.rad2deg(record.q), record.tau, RATE, **fields)
    with pytest.raises(RecordingError, match=r"shoulder.*are they degrees\? set units"):
        Problem(arm, (degrees,))


def test_objects_of_another_kind_are_refused(arm, record):
    law = PD(400.0, 40.0)
    with pytest.raises(ExperimentError, match=r"load_robot\('x.urdf'\)"):
        Problem("x.urdf", (record,))
    with pytest.raises(ExperimentError, match=r"'log\.csv' is not a recording"):
        Problem(arm, "log.csv")
    with pytest.raises(ExperimentError, match=r"loop is of type PD; .*Loop\(PD"):
        Problem(arm, (record,), law)
    with pytest.raises(ExperimentError, match="give a control law"):
        Loop("pd")
    assert Problem(arm, record, Loop(law)).recordings == (record,)


def test_identify_takes_a_problem(arm, record, tmp_path):
    with pytest.raises(IdentificationError, match=r"type Experiment; use experiment\.problem\(\)"):
        identify(load_experiment(write_experiment(tmp_path)), "ls")
    with pytest.raises(IdentificationError, match="takes a Problem"):
        identify(arm, "ls")


def test_a_simulation_without_inertia_says_which_link_has_none(arm, record):
    bare = replace(
        arm,
        links=(arm.links[0], Link("forearm")),
        rotor_inertia=np.array([0.1, 0.0]),
    )
    with pytest.raises(IdentificationError) as caught:
        identify(
            Problem(bare, (record,), loop_of(bare)),
            InstrumentalVariables(RandomWalk(), start="initial"),
        )
    (note,) = caught.value.__notes__
    assert "nominal inertia of link 'forearm' (joint 'elbow') is zero" in note


@pytest.mark.parametrize("samples", [20, 60, 150, 500])
@pytest.mark.parametrize("method", ["ls", "iv", "iv-full-rate", "piv"])
def test_records_that_are_too_short_are_refused_in_one_sentence(arm, samples, method):
    record = record_of(arm, samples, allow_constant=True)
    try:
        identify(Problem(arm, (record,), loop_of(arm, 6000.0, 180.0), mask=None), method)
    except IdentificationError:
        assert samples > 100
    except RecordingTooShort as error:
        assert error.samples == samples < error.minimum


def test_degrees_taken_for_radians_are_doubted_where_there_are_no_limits(arm):
    """With limits such positions are refused; without, every result carries the doubt."""
    endless = replace(arm, joints=tuple(replace(j, position_limits=None) for j in arm.joints))
    good = record_of(arm)
    said = [w for w in identify(Problem(endless, good), "ls").warnings if w.kind == "many turns"]
    assert said == []
    wrong = replace(good, q=np.rad2deg(good.q))
    result = identify(Problem(endless, wrong), "ls")
    said = [w for w in result.warnings if w.kind == "many turns"]
    assert {w.subject for w in said} == set(arm.joint_names)
    assert 'units = {q = "deg"}' in said[0].next_step
    span = np.rad2deg(np.ptp(good.q, axis=0))
    assert [w.evidence["span"].value for w in said] == pytest.approx(span.tolist())
    with pytest.raises(RecordingError, match="deg"):
        Problem(arm, wrong)
