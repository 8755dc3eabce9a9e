"""Fitted files, loaded back."""

import ast
import sys
import types
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pivident.foundation.errors import ExportError
from pivident.models.export.xml_edit import number
from pivident.studies.simulators.robot_files import fitted_file, fitted_urdf, isaac_actuators
from pivident.studies.simulators.simulator_fit import FittedValue

URDF = b"""<?xml version="1.0"?>
<!-- a leg -->
<robot name="leg"><link name="base"/><link name="a"/><link name="b"/><link name="c"/>
  <joint name="abduction" type="continuous"><parent link="base"/><child link="a"/>
    <dynamics damping="0" friction="0"/></joint>
  <joint name="hip" type="continuous"><parent link="a"/><child link="b"/></joint>
  <joint name="knee" type="continuous"><parent link="b"/><child link="c"/></joint>
</robot>
"""


def test_mujoco_reads_the_fitted_values_back(leg):
    model = mujoco.MjModel.from_xml_string(leg.file.content.decode())
    before = mujoco.MjModel.from_xml_path(str(leg.folder / "leg.xml"))
    for k, name in enumerate(leg.fit.robot.joint_names):
        assert model.joint(name).id == k
        for quantity, read in (
            ("armature", model.dof_armature),
            ("damping", model.dof_damping),
            ("frictionloss", model.dof_frictionloss),
        ):
            assert read[k] == pytest.approx(leg.fit.value(quantity, name), rel=1e-5)
    np.testing.assert_allclose(model.body_inertia, before.body_inertia)
    np.testing.assert_allclose(model.body_mass, before.body_mass)
    assert "knee frictionloss:" in leg.file.content.decode()
    assert any("no place for bias, delay" in s for s in leg.file.differences)


def test_meshes_are_found_from_another_folder(leg, tmp_path):
    folder = tmp_path / "robot"
    (folder / "meshes").mkdir(parents=True)
    corners = "0 0 0  1 0 0  0 1 0  0 0 1"
    text = (leg.folder / "leg.xml").read_text()
    obj = "".join(f"v {c}\n" for c in corners.split("  ")) + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (folder / "meshes" / "m.obj").write_text(obj)
    text = text.replace('<compiler angle="radian"/>', '<compiler angle="radian" meshdir="meshes"/>')
    text = text.replace("<worldbody>", '<asset><mesh name="m" file="m.obj"/></asset><worldbody>')
    text = text.replace(
        '<joint name="knee"', '<geom type="mesh" mesh="m" mass="0"/><joint name="knee"'
    )
    (folder / "leg.xml").write_text(text)
    out = tmp_path / "results" / "robot.xml"
    out.parent.mkdir()
    out.write_bytes(fitted_file(leg.fit, "mjcf", folder / "leg.xml", out.parent).content)
    assert mujoco.MjModel.from_xml_path(str(out)).nmesh == 1


def test_a_urdf_gets_damping_and_friction_and_nothing_else(leg, tmp_path):
    path = tmp_path / "leg.urdf"
    path.write_bytes(URDF)
    file = fitted_urdf(leg.fit, path)
    joints = ElementTree.fromstring(file.content).findall("joint")
    for joint in joints:
        dynamics = joint.find("dynamics")
        for key, quantity in (("damping", "damping"), ("friction", "frictionloss")):
            assert float(dynamics.get(key)) == leg.fit.value(quantity, joint.get("name"))
    text = file.content.decode()
    for joint in joints:
        name = joint.get("name")
        values = [number(leg.fit.value(q, name)) for q in ("damping", "frictionloss")]
        text = text.replace(values[0], "0", 1).replace(values[1], "0", 1)
    assert text.startswith('<?xml version="1.0"?>\n<!-- a leg -->')
    assert any("no place for armature, bias, delay" in s for s in file.differences)


def test_isaac_reads_the_table(leg, monkeypatch):
    made = {}
    module = types.ModuleType("isaaclab.actuators")
    module.DelayedPDActuatorCfg = lambda **fields: made.update(fields)
    monkeypatch.setitem(sys.modules, "isaaclab", types.ModuleType("isaaclab"))
    monkeypatch.setitem(sys.modules, "isaaclab.actuators", module)
    file = isaac_actuators(leg.fit, physics_step=2e-3)
    text = file.content.decode()
    ast.parse(text)
    exec(compile(text, "actuators.py", "exec"), {})
    assert made["stiffness"] == dict.fromkeys(leg.fit.robot.joint_names, 40.0)
    assert made["armature"]["knee"] == leg.fit.value("armature", "knee")
    assert made["viscous_friction"]["hip"] == leg.fit.value("damping", "hip")
    assert made["friction"] == made["dynamic_friction"]
    assert made["min_delay"] == made["max_delay"] == 2
    assert "-0.8 ms that whole steps cannot give" in text  # 3.2 ms are 2 steps of 2 ms less 0.8


def test_fitted_gains_go_through_gears_into_position_actuators(leg, tmp_path):
    """Torque of MuJoCo's actuators at one state: kp (q_ref - q) - kd dq with what was fitted."""
    actuators = """<actuator><position joint="hip" kp="9" kv="3" gear="-2"/><motor joint="knee"/>
    <general joint="abduction" gainprm="8" biastype="affine" biasprm="4 -16 -1"/></actuator>"""
    text = (leg.folder / "leg.xml").read_text().replace("</mujoco>", f"{actuators}</mujoco>")
    (tmp_path / "leg.xml").write_text(text)
    names, gains = leg.fit.robot.joint_names, {"kp": (31.0, 32.0, 33.0), "kd": (1.1, 1.2, 1.3)}
    values = [
        FittedValue(quantity, name, "", value, 0.1, value, value, value)
        for quantity, own in gains.items()
        for name, value in zip(names, own, strict=True)
    ]
    fit = replace(leg.fit, values=(*leg.fit.values, *values))
    model = mujoco.MjModel.from_xml_string(
        fitted_file(fit, "mjcf", tmp_path / "leg.xml", tmp_path).content.decode()
    )
    data = mujoco.MjData(model)
    data.qpos, data.qvel, data.ctrl = [0.2, -0.3, 0.1], [0.5, 0.4, -0.6], [0.3, 0.7, -0.2]
    mujoco.mj_forward(model, data)
    q_ref = np.array([-0.2 / 2 + 4 / 16, -0.3 / 2])  # as the given actuators hold them
    torque = [31.0, 32.0] * (q_ref - data.qpos[:2]) - [1.1, 1.2] * data.qvel[:2]
    np.testing.assert_allclose(data.qfrc_actuator, [*torque, 0.7], rtol=1e-5)


def test_formats_that_cannot_be_written_are_refused(leg, tmp_path):
    with pytest.raises(ExportError, match="no format 'sdf'"):
        fitted_file(leg.fit, "sdf", leg.folder / "leg.xml", tmp_path)
    with pytest.raises(ExportError, match=r"leg\.xml is no URDF"):
        fitted_file(leg.fit, "urdf", leg.folder / "leg.xml", tmp_path)
    with pytest.raises(ExportError, match="only a URDF or MJCF"):
        fitted_file(leg.fit, "mjcf", tmp_path / "robot.toml", tmp_path)
