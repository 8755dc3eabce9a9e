"""SDF files, read back element by element into a robot of the same torques."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest

from pivident.foundation.errors import ExportError
from pivident.models.export.sdf import to_sdf
from pivident.models.runnable_model import runnable_model
from pivident.robot.description import Joint, Link, Robot
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.friction import FrictionLaw, asymmetric_coulomb, spring, viscous
from pivident.robot.gallery import load_robot
from pivident.robot.inertia import from_center_of_mass, tensor
from pivident.robot.transmission import Transmission
from tests.models.export.robots import with_values


def numbers(element, path):
    return np.array(element.findtext(path).split(), dtype=float)


def read(content, gravity):
    """The robot of an SDF, with damping and friction as nominal values."""
    model = ElementTree.fromstring(content).find("model")
    links = {link.get("name"): link for link in model.findall("link")}
    moving = [j for j in model.findall("joint") if j.get("type") != "fixed"]
    children = [j.findtext("child") for j in moving]
    joints, bodies, nominal = [], [], {}
    for i, joint in enumerate(moving):
        link, parent = links[joint.findtext("child")], joint.findtext("parent")
        pose = link.find("pose")
        assert pose.get("relative_to") == parent
        xyz, turn = np.split(numbers(link, "pose"), 2)
        joints.append(
            Joint(joint.get("name"), joint.get("type"),
                  children.index(parent) if parent in children else -1,
                  rotation_from_rpy(*turn), xyz)
        )  # fmt: skip
        at_center = [float(link.findtext(f"inertial/inertia/i{a}")) for a in
                     ("xx", "xy", "xz", "yy", "yz", "zz")]  # fmt: skip
        center = numbers(link, "inertial/pose")[:3]
        mass = float(link.findtext("inertial/mass"))
        bodies.append(Link(link.get("name"), from_center_of_mass(mass, center, tensor(at_center))))
        nominal[f"fv{i + 1}"] = float(joint.findtext("axis/dynamics/damping"))
        nominal[f"ks{i + 1}"] = float(joint.findtext("axis/dynamics/spring_stiffness"))
    n = len(joints)
    direct = Transmission.direct(n)
    return Robot("read", tuple(joints), tuple(bodies), gravity, np.zeros(n), direct, nominal)


@pytest.mark.parametrize("name", ["staubli_tx40", "mitsubishi_rv2sq", "emps"])
def test_an_sdf_that_is_read_back_has_the_models_torques(name):
    robot = load_robot(name).with_friction(
        FrictionLaw((viscous(), *asymmetric_coulomb(), spring()))
    )
    model = with_values(robot)
    file = to_sdf(model)
    again = read(file.content, robot.gravity)
    again = runnable_model(again.with_friction(FrictionLaw((viscous(), spring()))))
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.uniform(-2, 2, (3, 50, robot.size))
    by_hand = [
        file.left_out.get(p.name, 0.0) + (v - file.left_out.get(p.name, 0.0)) * (p.stem[:2] == "fc")
        for p, v in zip(model.parameters, model.values, strict=True)
    ]
    theirs = again.torque(q, dq, ddq) + model.regressor.torque(q, dq, ddq, np.array(by_hand))
    expected = model.torque(q, dq, ddq)
    np.testing.assert_allclose(theirs, expected, atol=1e-9 * np.abs(expected).max())
    friction = ElementTree.fromstring(file.content).findtext(
        "model/joint[2]/axis/dynamics/friction"
    )
    value = {p.name: v for p, v in zip(model.parameters, model.values, strict=True)}
    assert float(friction) == pytest.approx((value["fcp1"] + value["fcn1"]) / 2, rel=1e-15)


def test_limits_gravity_and_differences_are_told():
    model = with_values(load_robot("staubli_tx40"))
    file = to_sdf(model)
    limit = ElementTree.fromstring(file.content).find("model/joint[@name='joint_2']/axis/limit")
    joint = model.robot.joints[1]
    assert [float(limit.findtext(k)) for k in ("lower", "upper", "effort", "velocity")] == [
        *joint.position_limits,
        joint.torque_limit,
        joint.rated_speed,
    ]
    told = " ".join(file.differences)
    assert all(word in told for word in ("ia1", "off3", "fcm6", "gravity in the world"))


def test_names_are_escaped_and_massless_links_refused():
    model = with_values(load_robot("planar_2r"))
    links = (replace(model.robot.links[0], name="a<b>&\"c'"), model.robot.links[1])
    named = replace(model, robot=replace(model.robot, links=links, name="<&>"))
    root = ElementTree.fromstring(to_sdf(named).content)
    assert root.findtext("model/joint[@name='elbow']/parent") == "a<b>&\"c'"
    with pytest.raises(ExportError, match="has a mass of 0 kg"):
        to_sdf(replace(model, values=np.zeros(len(model.values))))
