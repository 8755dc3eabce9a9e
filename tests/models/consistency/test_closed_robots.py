"""Consistent parameters of mechanisms with closed loops, and their files."""

import csv
import io

import numpy as np
import pytest

import pivident as pv
from pivident.app.cli import main
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.errors import RobotDescriptionError
from pivident.judgement.diagnostics.consistent_estimate import consistent_estimate
from pivident.judgement.diagnostics.stored_consistent import consistent_csv
from pivident.loop import virtual_pd
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.consistency.constraints import Bounds
from pivident.models.consistency.options import ConsistencyOptions
from pivident.models.consistency.pseudo_inertia import pseudo_inertia
from pivident.models.export.load_back import verify_with_mujoco
from pivident.models.export.mjcf import to_mjcf
from pivident.models.runnable_model import runnable_model
from pivident.robot.mjcf import read_mjcf
from pivident.studies.tables.inputs import consistent_parameters


def identified(name, reach):
    """A short noisy record: the estimate, and the true values of its parameters."""
    robot = pv.load_robot(name)
    rest = robot.constraints.posture[list(robot.places)]
    t = np.arange(0.0, 4.0, 0.002)[:, None]
    waves = np.sin(np.array([5.1, 7.3, 6.1, 8.3])[: robot.size] * t)
    loop = pv.Loop(virtual_pd(robot, rest))
    noise = [2e-3 * joint.torque_limit for joint in robot.joints]
    reference = rest + reach * waves * np.minimum(t, 1.0) ** 2
    made = pv.simulate(robot, loop, reference, rate=500.0, encoder=1e-6, torque=noise, seed=5)
    result = pv.identify(pv.Problem(robot, (made.recording,), loop), "ls")
    return result, np.array([made.truth[n] for n in result.names])


@pytest.fixture(scope="module")
def five_bar():
    return identified("five_bar", 0.3)


@pytest.fixture(scope="module")
def delta():
    return identified("delta", 0.3)


def test_bodies_of_a_mechanism_have_the_torques_of_the_estimate(five_bar):
    free, _ = five_bar
    model = make_consistent(free)
    assert model.was_consistent and [b.name for b in model.links] == [
        "left_crank", "left_rod", "right_crank", "right_rod",
    ]  # fmt: skip
    np.testing.assert_allclose(model.theta, free.theta, rtol=0, atol=1e-8)
    record = free.recordings[0]
    q, dq, ddq = (x[:50] for x in (record.q, record.dq, record.ddq))
    ours = regressor_of(free.robot, free.parameters).torque(q, dq, ddq, free.theta)
    np.testing.assert_allclose(model.predict(q, dq, ddq), ours, rtol=0, atol=1e-7)


def test_links_without_a_body_have_none_and_the_others_are_possible(delta):
    free, truth = delta
    model = make_consistent(free)
    assert not model.was_consistent
    bodies = [link.name for link in free.robot.tree.links if link.is_body]
    assert [b.name for b in model.links] == bodies and len(bodies) == 7
    for place in model._space.links:
        assert np.linalg.eigvalsh(pseudo_inertia(model.values[place]))[0] > 0.0
    # what physics allows is nearer to the truth than what noise has made of it
    far = [np.linalg.norm((theta - truth) / free.std) for theta in (model.theta, free.theta)]
    assert far[0] < far[1]
    assert model.torque_error < 1.02 * model.torque_error_free


def test_a_bound_on_a_passive_link_holds_and_one_on_a_frame_is_refused(delta):
    free, _ = delta
    bounded = make_consistent(free, bounds=Bounds(mass={"platform": (0.3, 0.35)}), accept_far=True)
    assert 0.3 - 1e-4 <= bounded.link("z").mass <= 0.35 + 1e-4
    with pytest.raises(RobotDescriptionError, match=r"'elbow_1' is a frame without a body; known"):
        make_consistent(free, bounds=Bounds(mass={"elbow_1": (0.1, 0.2)}))


def test_the_files_and_the_report_name_joints_of_the_tree(five_bar):
    free, _ = five_bar
    estimate = consistent_estimate(free, ConsistencyOptions())
    rows = list(csv.DictReader(io.StringIO(consistent_csv(estimate))))
    assert {(r["joint"], r["link"]) for r in rows if r["name"].startswith("zz")} == {
        ("left", "left_crank"), ("left_elbow", "left_rod"), ("right", "right_crank"),
        ("right_elbow", "right_rod"),
    }  # fmt: skip
    assert [row.name for row in estimate.links] == [b.name for b in estimate.model.links]
    assert "right_elbow" in consistent_parameters(estimate.model).columns["joint"]


@pytest.mark.parametrize("record", ["five_bar", "delta"])
def test_mujoco_simulates_the_consistent_model(record, request):
    free, _ = request.getfixturevalue(record)
    model = runnable_model(make_consistent(free))
    verified = verify_with_mujoco(to_mjcf(model), model)
    assert verified.agrees, verified


def test_a_free_estimate_is_written_on_standard_parameters(five_bar):
    free, _ = five_bar
    model = runnable_model(free)
    np.testing.assert_allclose(model.base_values, free.theta, rtol=0, atol=1e-10)


def test_a_result_on_disk_is_exported_but_not_as_a_tree(five_bar, tmp_path, capsys):
    five_bar[0].save(tmp_path / "result")
    command = ["export", str(tmp_path / "result"), "--out", str(tmp_path / "bar.xml"), "--to"]
    assert main([*command, "mjcf"]) == 0
    assert "Loaded back: torques of 196 random states by MuJoCo" in capsys.readouterr().out
    assert read_mjcf(tmp_path / "bar.xml").joint_names == ("left", "right")
    assert main([*command, "numpy"]) == 0
    assert "Loaded back: torques, torques by the regressor" in capsys.readouterr().out
    assert main([*command, "urdf"]) == 1
    assert "export it as MJCF, or as JSON" in capsys.readouterr().err
