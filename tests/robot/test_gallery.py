import json
import subprocess
import sys

import numpy as np
import pytest

from pivident.dynamics.parameters import standard_parameters
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.gallery import gallery_names, load_robot
from pivident.robot.urdf import read_urdf
from tests.robot.kinematics import gravity_torque, link_poses

SIX_AXES = ["staubli_tx40", "mitsubishi_rv2sq"]


def test_the_gallery_has_these_robots():
    assert gallery_names() == (
        "delta", "emps", "five_bar", "mitsubishi_rv2sq", "orthoglide", "parallelogram_palletizer",
        "planar_2r", "quadruped", "scara", "staubli_tx40",
    )  # fmt: skip


@pytest.mark.parametrize("name", gallery_names())
def test_every_robot_of_the_gallery_knows_its_bounds_and_its_friction(name):
    robot = load_robot(name).on_fixed_base
    assert np.isfinite(robot.rated_speeds).all()
    names = {parameter.name for parameter in standard_parameters(robot)}
    assert robot.friction_nominal.keys() <= names
    assert all(term.gamma for joint in robot.joints for term in joint.friction.terms)
    assert robot.description


def test_importing_robots_loads_nothing_heavy():
    check = "import sys, pivident.robot; print({'pydantic', 'numba', 'scipy'} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"


def test_a_robot_is_loaded_by_file_as_well(tmp_path):
    table = tmp_path / "arm.toml"
    table.write_text('name = "by table"\n[[joints]]\nname = "a"', encoding="utf-8")
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(
        '<robot name="by urdf"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/></joint></robot>',
        encoding="utf-8",
    )
    assert load_robot(table).name == "by table"
    assert load_robot(str(urdf)).name == "by urdf"


def test_a_misspelt_robot_gets_the_nearest_names():
    with pytest.raises(RobotDescriptionError, match=r"no robot 'stabli_tx40'; .*'staubli_tx40'"):
        load_robot("stabli_tx40")


@pytest.mark.parametrize(
    "name", ["../gallery/emps", "/etc/passwd", "emps.yaml", "", "a b", "emps\n", "..\\emps"]
)
def test_a_gallery_name_is_a_name_and_never_a_path(name):
    with pytest.raises(RobotDescriptionError, match="neither a gallery name nor a robot file"):
        load_robot(name)


def test_emps_slides_level_and_its_mass_is_nominal():
    robot = load_robot("emps")
    assert robot.joints[0].kind == "prismatic"
    np.testing.assert_allclose(gravity_torque(robot, [0.1]), 0.0, atol=1e-7)
    assert robot.links[0].inertia[9] == pytest.approx(95.1089)
    assert robot.transmission.drive_gain[0] == 35.15065188248547
    assert robot.joints[0].rated_speed == 1.0
    assert robot.joints[0].friction.terms[1].gamma == 2000.0


def test_the_planar_arm_carries_its_weight_as_the_textbook_says():
    q1, q2 = 0.3, -0.8
    shoulder = 9.81 * ((4 * 0.2 + 2.5 * 0.4) * np.cos(q1) + 2.5 * 0.15 * np.cos(q1 + q2))
    elbow = 9.81 * 2.5 * 0.15 * np.cos(q1 + q2)
    torque = gravity_torque(load_robot("planar_2r"), [q1, q2])
    np.testing.assert_allclose(torque, [shoulder, elbow], atol=1e-7)


def test_the_wrist_of_the_tx40_is_coupled_through_the_motor_of_joint_6():
    robot = load_robot("staubli_tx40")
    (coupling,) = robot.couplings
    assert (coupling.motor, coupling.joint, coupling.ratio) == (5, 4, 1.0)
    expected = np.diag([32.0, 32, 45, -48, 45, 32])
    expected[5, 4] = 32
    np.testing.assert_array_equal(robot.transmission.reduction, expected)


def test_one_percent_of_the_tx40s_rated_speeds_is_the_laboratorys_mask():
    mask = [0.05009095, 0.05009095, 0.07504916, 0.0715585, 0.05585054, 0.12217305]
    np.testing.assert_allclose(0.01 * load_robot("staubli_tx40").rated_speeds, mask, rtol=1e-6)


@pytest.mark.record
@pytest.mark.parametrize("name", SIX_AXES)
def test_the_six_axis_arms_have_the_reference_numbers(name, reference_dir):
    reference = json.loads((reference_dir / "robots.json").read_text())[name]
    robot = load_robot(name)
    table = reference["mdh"]
    for i, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
        ca, sa = np.cos(table["alpha"][i]), np.sin(table["alpha"][i])
        ct, st = np.cos(table["theta_offset"][i]), np.sin(table["theta_offset"][i])
        rotation = [[ct, -st, 0], [ca * st, ca * ct, -sa], [sa * st, sa * ct, ca]]
        np.testing.assert_allclose(joint.rotation, rotation, atol=1e-12)
        origin = [table["a"][i], -sa * table["d"][i], ca * table["d"][i]]
        np.testing.assert_allclose(joint.translation, origin, atol=1e-12)
        limits = np.radians(reference["position_limit_deg"][i])
        np.testing.assert_allclose(joint.position_limits, limits, atol=1e-12)
        assert link.inertia[9] == reference["mass"][i]
        assert robot.friction_nominal[f"fv{i + 1}"] == reference["fv"][i]
        assert robot.friction_nominal[f"fc{i + 1}"] == reference["fc"][i]
    np.testing.assert_array_equal(robot.rotor_inertia, reference["rotor_inertia"])
    np.testing.assert_allclose(robot.rated_speeds, np.radians(reference["velocity_limit_deg_s"]))


@pytest.mark.record
def test_the_tx40s_inertias_are_the_reference_ones(reference_dir):
    reference = json.loads((reference_dir / "robots.json").read_text())["staubli_tx40"]
    for i, link in enumerate(load_robot("staubli_tx40").links):
        np.testing.assert_array_equal(
            link.inertia[:6], reference["inertia_at_frame_XX_XY_XZ_YY_YZ_ZZ"][i]
        )
        np.testing.assert_array_equal(link.inertia[6:9], reference["first_moment"][i])


@pytest.mark.record
def test_the_rv2sqs_inertias_are_the_reference_ones_moved_to_the_joints(reference_dir):
    reference = json.loads((reference_dir / "robots.json").read_text())["mitsubishi_rv2sq"]
    for i, link in enumerate(load_robot("mitsubishi_rv2sq").links):
        m, (x, y, z) = reference["mass"][i], reference["center_of_mass"][i]
        np.testing.assert_allclose(link.inertia[6:9], [m * x, m * y, m * z])
        shift = [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y]
        at_center = reference["inertia_at_center_of_mass_XX_XY_XZ_YY_YZ_ZZ"][i]
        np.testing.assert_allclose(
            link.inertia[:6], np.array(at_center) + m * np.array(shift), atol=1e-12
        )


@pytest.mark.record
def test_the_tx40s_table_and_its_urdf_are_the_same_arm(data_dir):
    """Zero of the table is the controller's zero, zero of the URDF is the pose at rest."""
    urdf = read_urdf(data_dir / "staubli_tx40" / "tx40_mdh_modified.urdf")
    table = load_robot("staubli_tx40")
    q = np.random.default_rng(4).uniform(-1, 1, 6)
    rest = np.array([0, np.pi / 2, -np.pi / 2, 0, 0, 0])
    base = np.eye(4)
    base[2, 3] = 0.32
    np.testing.assert_allclose(base @ link_poses(table, q + rest), link_poses(urdf, q), atol=1e-9)


@pytest.mark.record
def test_a_log_of_the_tx40s_motors_needs_no_position_offset(data_dir):
    """At rest the brakes are open and joint 2 holds the level arm: nominal gravity says so."""
    folder = data_dir / "staubli_tx40"
    motor_positions, motor_torques = (
        np.loadtxt(folder / f"{name}_data.csv.gz", delimiter=",", skiprows=1, max_rows=150).mean(0)
        for name in ("pos_read", "curr")
    )
    robot = load_robot("staubli_tx40")
    q = robot.transmission.joint_positions(motor_positions)
    tau = robot.transmission.joint_torques(motor_torques)
    np.testing.assert_allclose(np.degrees(q), [0, 90, -90, 0, 0, 0], atol=0.01)
    stiction = np.array([robot.friction_nominal[f"fc{i}"] for i in range(1, 7)])
    assert tau[1] < -20
    assert (np.abs(tau - gravity_torque(robot, q)) < stiction).all()
    shifted = gravity_torque(robot, q - np.array([0, np.pi / 2, -np.pi / 2, 0, 0, 0]))
    assert abs(tau[1] - shifted[1]) > stiction[1]
