"""URDF files: loaded back by Pinocchio and MuJoCo, everything else byte for byte."""

import gzip
import hashlib
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.app.cli.export import check_targets, write_export
from pivident.foundation.errors import ExportError, PividentError, RobotDescriptionError
from pivident.models.export.load_back import verify_with_mujoco, verify_with_pinocchio
from pivident.models.export.urdf import to_urdf
from pivident.models.export.xml_edit import quoted, rpy
from pivident.models.runnable_model import runnable_model
from pivident.robot.frames import rotation_about, rotation_from_rpy
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    asymmetric_viscous,
    coulomb,
    dahl,
    load_dependent,
    offset,
    ripple,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf, read_urdf
from tests.models.export.robots import ARM, UR, random_tree, ur, with_values
from tests.robot.test_printed_angles import urdf

if sys.platform == "win32":
    pytest.skip("there is no Pinocchio for Windows", allow_module_level=True)

BOTH = (verify_with_pinocchio, verify_with_mujoco)

#: Friction with everything that a URDF cannot say.
RICH = FrictionLaw(
    (
        *asymmetric_viscous(),
        *asymmetric_coulomb(),
        stribeck(0.1),
        load_dependent(),
        *ripple(12.0),
        spring(),
    )
)


def said(file, pattern):
    return [float(x) for x in re.findall(pattern, file.text)]


@pytest.mark.parametrize("name", ["staubli_tx40", "mitsubishi_rv2sq", "planar_2r", "emps"])
def test_a_new_urdf_of_a_gallery_robot_has_the_models_torques(name):
    model = with_values(load_robot(name))
    file = to_urdf(model)
    for verify in BOTH:
        assert verify(file, model).agrees, verify(file, model)


@pytest.mark.parametrize("verify", BOTH)
def test_angles_that_the_original_rounds_are_written_in_full(verify):
    original = urdf("1.57", "3.1416")
    model = with_values(parse_urdf(original))
    file = to_urdf(model, original.encode())
    assert verify(file, model).agrees, verify(file, model)
    (sentence,) = [text for text in file.differences if "written in full" in text]
    assert sentence.endswith("two, flange, three")


@pytest.mark.parametrize("verify", BOTH)
def test_a_urdf_keeps_its_torques_when_inertials_are_replaced(verify):
    model = with_values(ur())
    file = to_urdf(model, UR.encode())
    assert verify(file, model).agrees, verify(file, model)


@pytest.mark.parametrize("verify", BOTH)
def test_frozen_joints_may_sit_elsewhere(verify):
    frozen = {"finger_slide": 0.03}
    model = with_values(ur(frozen))
    file = to_urdf(model, UR.encode(), frozen=frozen)
    assert verify(file, model, frozen=frozen).agrees
    assert not verify(file, model).agrees


def test_a_wrong_number_in_the_file_is_found():
    model = with_values(ur())
    file = to_urdf(model, UR.encode())
    number = re.search(r'<joint name="lift".*?friction="([^"]+)"', file.text, re.S)
    wrong = file.text[: number.start(1)] + "7" + file.text[number.start(1) :]
    verified = verify_with_pinocchio(replace(file, content=wrong.encode()), model)
    assert verified.relative > 0.01


def test_friction_that_a_urdf_cannot_say_is_named_and_completes_the_torque():
    model = with_values(ur().with_friction(RICH))
    file = to_urdf(model, UR.encode())
    for verify in BOTH:
        assert verify(file, model).agrees, verify(file, model)
    told = " ".join(file.differences)
    for stem in ("ia1", "fvp1", "fvn1", "fs1", "fl1", "rc_12_1", "ks1"):
        assert stem in file.left_out and stem in told
    mean = {p.name: v for p, v in zip(model.parameters, model.values, strict=True)}
    damping = re.search(r'<joint name="lift".*?damping="([^"]+)"', file.text, re.S)
    assert float(damping[1]) == pytest.approx((mean["fvp2"] + mean["fvn2"]) / 2, rel=1e-15)
    assert file.left_out["fcp2"] == pytest.approx((mean["fcp2"] - mean["fcn2"]) / 2)
    assert file.left_out["fcn2"] == -file.left_out["fcp2"]


def test_presliding_is_written_as_dry_friction_and_named():
    law = FrictionLaw((viscous(), dahl(0.01), offset()))
    model = with_values(load_robot("planar_2r").with_friction(law))
    file = to_urdf(model)
    values = {p.name: v for p, v in zip(model.parameters, model.values, strict=True)}
    assert said(file, 'friction="([^"]+)"') == [values["fc1"], values["fc2"]]
    assert verify_with_pinocchio(file, model).agrees
    assert any("no elastic displacement" in s and "0.01 rad" in s for s in file.differences)


def test_the_size_of_what_is_missing_is_told_in_newton_metres():
    robot = load_robot("planar_2r").with_friction(FrictionLaw((offset(), coulomb(gamma=100.0))))
    model = runnable_model(robot)
    values = [{"ia1": 0.25, "off2": -1.5, "fc1": 4.0}.get(p.name, v) for p, v in
              zip(model.parameters, model.values, strict=True)]  # fmt: skip
    told = to_urdf(replace(model, values=np.array(values))).differences
    assert any("ia1 0.25 kg m² (2.5 N m at 10 rad/s²)" in s for s in told)
    assert any("off2 -1.5 N m" in s for s in told)
    assert any("fc1 4 N m (0.063 rad/s)" in s for s in told)
    assert any("0 -9.81 0 m/s²" in s for s in told)


def test_coupled_motors_are_named():
    told = to_urdf(with_values(load_robot("staubli_tx40"))).differences
    (sentence,) = [s for s in told if "second joint" in s]
    assert all(name in sentence for name in ("iam6", "fvm6", "fcm6"))


def test_bodies_behind_fixed_joints_become_zero_and_stay_elements():
    text = to_urdf(with_values(ur()), UR.encode()).text
    tool = re.search(r'<link name="tool">.*?</link>', text, re.S)[0]
    assert '<mass value="0"/>' in tool
    # MuJoCo would make a mass up from the shape of a body without inertial
    assert '<mass value="0"/>' in re.search(r'<link name="cover">.*?</link>', text, re.S)[0]


def test_frozen_bodies_are_kept_subtracted_or_scaled_down():
    heavy, light = with_values(ur(), mass=30.0), with_values(ur(), mass=0.01)
    kept, scaled = to_urdf(heavy, UR.encode()), to_urdf(light, UR.encode())
    assert any("were subtracted, 0.1 kg: 'finger'" in s for s in kept.differences)
    assert any("scaled by 0." in s for s in scaled.differences)
    finger = r'<link name="finger">.*?<mass value="([^"]+)"'
    assert re.search(finger, kept.text, re.S)[1] == "0.1"
    assert 0.0 < float(re.search(finger, scaled.text, re.S)[1]) < 0.1
    for verify in BOTH:
        assert verify(scaled, light).agrees


def masked(content):
    """A URDF without all inertials and without the values of damping and friction."""
    content = re.sub(rb"<inertial>.*?</inertial>", b"<inertial/>", content, flags=re.S)
    return re.sub(rb"<dynamics[^>]*>", b"<dynamics/>", content)


@pytest.mark.record
def test_the_rest_of_tiagos_urdf_stays_byte_for_byte(data_dir):
    path = data_dir / "tiago" / "tiago_48_hey5.urdf.gz"
    kept = ["torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8))]
    robot = read_urdf(path, joints=kept)
    before, model = gzip.decompress(path.read_bytes()), with_values(robot, mass=100.0)
    for original in (before, path.read_bytes(), before.replace(b"\n", b"\r\n")):
        file = to_urdf(model, original)
        plain = before if original[:2] == b"\x1f\x8b" else original
        assert masked(file.content) == masked(plain)
        assert file.content != plain
    touched = {"torso_lift_link", "arm_7_link", "wrist_ft_link"}
    old, new = (
        re.findall(rb'(<link name="([^"]+)".*?</link>)', content, re.S)
        for content in (before, to_urdf(model, before).content)
    )
    changed = {a[1].decode() for a, b in zip(old, new, strict=True) if a[0] != b[0]}
    assert touched <= changed
    assert not any(name.startswith(("base", "wheel", "hand_thumb")) for name in changed)
    assert verify_with_pinocchio(to_urdf(model, path.read_bytes()), model).agrees


@pytest.mark.record
def test_tiago_runs_in_mujoco_once_two_bodies_of_its_own_are_possible(data_dir):
    path = data_dir / "tiago" / "tiago_48_hey5.urdf.gz"
    kept = ["torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8))]
    model = with_values(read_urdf(path, joints=kept), mass=2.0)
    file = to_urdf(model, path.read_bytes())
    assert any("'base_antenna_left_link', 'base_antenna_right_link'" in s for s in file.differences)
    refused = verify_with_mujoco(file, model)
    assert "base_antenna_left_link" in refused.skipped
    repaired = re.sub(
        rb'ixx="0.00000002371"[^/]*izz="[^"]*"',
        b'ixx="1e-8" ixy="0" ixz="0" iyy="1e-8" iyz="0" izz="1e-8"',
        gzip.decompress(path.read_bytes()),
    )
    file = to_urdf(model, repaired)
    assert verify_with_mujoco(file, model).agrees, verify_with_mujoco(file, model)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_trees_keep_their_torques(seed):
    rng = np.random.default_rng(seed)
    text = random_tree(rng, int(rng.integers(1, 8)))
    names = parse_urdf(text).joint_names
    kept = [name for name in names if rng.random() < 0.7] or [names[0]]
    frozen = {name: float(rng.uniform(-2, 2)) for name in names if name not in kept}
    model = with_values(parse_urdf(text, joints=kept, frozen=frozen), seed % 1000, mass=5.0)
    changed, new = to_urdf(model, text.encode(), frozen=frozen), to_urdf(model)
    assert verify_with_pinocchio(changed, model, frozen=frozen).agrees
    assert verify_with_mujoco(changed, model, frozen=frozen).agrees
    assert verify_with_pinocchio(new, model).agrees
    assert verify_with_mujoco(new, model).agrees


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-9, 1e-4, 1.0]))
def test_roll_pitch_yaw_give_the_rotation_back_even_at_a_right_angle(seed, off):
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-np.pi, np.pi, 3)
    angles[1] = np.pi / 2 * rng.choice([-1, 1]) + off * rng.normal()
    rotation = rotation_from_rpy(*angles) @ rotation_about(np.array([0.0, 0.0, 1.0]), 1.0)
    np.testing.assert_allclose(rotation_from_rpy(*rpy(rotation)), rotation, atol=4e-15)


def test_a_new_urdf_is_read_back_as_the_same_robot():
    model = with_values(load_robot("staubli_tx40"))
    again = parse_urdf(to_urdf(model).content)
    for ours, theirs in zip(model.robot.joints, again.joints, strict=True):
        np.testing.assert_allclose(theirs.rotation, ours.rotation, atol=1e-15)
        assert (theirs.position_limits, theirs.rated_speed) == (
            ours.position_limits,
            ours.rated_speed,
        )
    inertia = [model.inertial(i) for i in range(6)]
    np.testing.assert_allclose([link.inertia for link in again.links], inertia, atol=1e-14)


# --- bad input ---


def test_joints_that_do_not_match_are_named_with_the_nearest():
    model = with_values(parse_urdf(UR.replace('"lift"', '"lyft"'), joints=("shoulder_pan", "lyft")))
    with pytest.raises(RobotDescriptionError, match=r"no moving joint 'lyft'; did you mean 'lift'"):
        to_urdf(model, UR.encode())


def test_another_robot_with_the_same_names_is_refused():
    model = with_values(ur())
    with pytest.raises(ExportError, match=r"another robot: the frame of joint 'elbow' is 0\.1 m"):
        to_urdf(model, UR.replace("0.425", "0.525").encode())
    with pytest.raises(ExportError, match="joint 'shoulder_pan' is prismatic there"):
        changed = UR.replace('shoulder_pan" type="revolute"', 'shoulder_pan" type="prismatic"')
        to_urdf(model, changed.encode())


def test_changed_nominal_inertias_are_told():
    told = to_urdf(with_values(ur()), UR.replace('mass value="3.7"', 'mass value="2"').encode())
    assert any("nominal inertias are not those" in s for s in told.differences)


def test_links_without_mass_are_refused_and_impossible_ones_told():
    model = runnable_model(load_robot("planar_2r"))
    masses = [k for k, p in enumerate(model.parameters) if p.stem == "m"]
    values = model.values.copy()
    values[masses[1]] = -0.5
    with pytest.raises(ExportError, match=r"link 'forearm' has a mass of -0\.5 kg"):
        to_urdf(replace(model, values=values))
    values[masses[1]] = 1e-3
    assert any("no body can have" in s for s in to_urdf(replace(model, values=values)).differences)


def test_names_are_escaped_and_impossible_characters_refused():
    model = with_values(ur())
    robot = replace(model.robot, name='a "robot" <&> …')
    new = to_urdf(replace(model, robot=robot))
    assert parse_urdf(new.content).name == 'a "robot" <&> …'
    assert [link.name for link in parse_urdf(new.content).links][1] == 'upper "arm"'
    with pytest.raises(ExportError, match="XML cannot write"):
        quoted("bell \a")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "iso-8859-1"])
def test_other_encodings_and_line_ends_stay(encoding):
    text = UR.replace("made up", "für Ärmel").replace("\n", "\r\n")
    if encoding == "iso-8859-1":
        text = text.replace('<?xml version="1.0" ?>', '<?xml version="1.0" encoding="ISO-8859-1"?>')
    original = text.encode(encoding)
    file = to_urdf(with_values(ur()), original)
    changed = file.content.decode(encoding)
    assert masked(changed.encode()).startswith(masked(text.encode())[:900])
    assert "\n" not in changed.replace("\r\n", "")
    assert parse_urdf(file.content).joint_names == (*ARM, "finger_slide")
    assert file.content[:2] == original[:2]


def test_the_original_file_is_never_written(tmp_path):
    source = tmp_path / "arm.urdf"
    source.write_bytes(UR.encode())
    digest = hashlib.sha256(source.read_bytes()).hexdigest()
    file = to_urdf(with_values(ur()), source.read_bytes())
    link = tmp_path / "link.urdf"
    link.symlink_to(source)
    for target in (source, link, tmp_path / "." / "arm.urdf"):
        with pytest.raises(ExportError, match="is a file that the export is made from"):
            check_targets(file, target, (source,))
    with pytest.raises(ExportError, match="is a folder"):
        check_targets(file, tmp_path, (source,))
    assert hashlib.sha256(source.read_bytes()).hexdigest() == digest
    (written,) = write_export(file, tmp_path / "new" / "arm.urdf.gz")
    assert gzip.decompress(written.read_bytes()) == file.content
    (plain,) = write_export(file, tmp_path / "out.urdf")
    assert plain.read_bytes() == file.content
    there = sorted(path.name for path in tmp_path.iterdir())
    assert there == ["arm.urdf", "link.urdf", "new", "out.urdf"]


def test_a_folder_that_cannot_be_written_is_left_as_it_was(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(PividentError, match="cannot write"):
        write_export(to_urdf(with_values(ur())), tmp_path / "file" / "arm.urdf")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x1f\x8b nonsense", "damaged gzip"),
        (b"<robot>", "not XML"),
        (b'<!DOCTYPE robot [<!ENTITY a "b">]><robot name="a"/>', "document type"),
    ],
)
def test_originals_that_cannot_be_used(content, words):
    with pytest.raises((ExportError, RobotDescriptionError), match=words):
        to_urdf(with_values(ur()), content)


@pytest.mark.parametrize("name", ["base", "universe", "root_joint", "joint_2"])
@pytest.mark.parametrize("original", [False, True])
def test_joints_and_links_may_share_names(name, original):
    robot = load_robot("planar_2r")
    joints = (robot.joints[0], replace(robot.joints[1], name=name))
    links = (replace(robot.links[0], name=robot.joints[0].name), replace(robot.links[1], name=name))
    model = with_values(replace(robot, joints=joints, links=links))
    file = to_urdf(model)
    if original:  # the same names in a file that was there before
        model = with_values(parse_urdf(file.text))
        file = to_urdf(model, file.content)
    for verify in BOTH:
        check = verify(file, model)
        assert check.agrees or "refuses" in check.skipped, str(check)
    assert name == "universe" or verify_with_pinocchio(file, model).agrees
