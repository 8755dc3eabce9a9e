"""Torques from which the drives have taken gravity out, told from gravity in another direction."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.logs.log import Log
from pivident.judgement.audit.examination import Examination
from pivident.judgement.audit.gravity import NO_GRAVITY, GravityCheck, gravity_shares
from pivident.judgement.audit.inverse_model import DescribedTorque, build_inverse_model
from pivident.judgement.audit.timing import check_timing
from pivident.robot.urdf import parse_urdf
from tests.other_arms import Setting, make_log

SETTING = Setting("regular", 200.0, 20.0, 0.0, 0.005, "none", 0.8)


def examined(
    gravity: tuple[float, ...] | None, described=(0.0, 0.0, -9.81), unit: float = 1.0
) -> Examination:
    """The check of an arm of Pinocchio's; ``gravity``: of the logged torques, None: as described.

    Both are arms of the same masses and frictions.
    """
    made = make_log(6, SETTING, joints=4)
    robot = parse_urdf(made.arm.urdf)
    tau = made.tau
    if gravity is not None:
        tau = tau - static(robot, made.q) + static(robot.with_gravity(np.array(gravity)), made.q)
    channels = {"q": made.q, "tau": unit * tau}
    log = Log("log", robot.joint_names, {}, {"t": made.t}, logged=channels, channels=channels,
              robot=robot.with_gravity(np.array(described)))  # fmt: skip
    timing = check_timing(log)
    return GravityCheck().examine(Examination(log, timing, build_inverse_model(log, timing)))


def static(robot, q):
    """Torque of gravity by the description, shape (samples, joints)."""
    from pivident.dynamics.parameters import nominal_values, standard_parameters
    from pivident.dynamics.robot_regressor import regressor_of

    parameters = [p for p in standard_parameters(robot) if p.is_inertial]
    rest = np.zeros_like(q)
    values = nominal_values(robot, tuple(parameters))
    return regressor_of(robot, parameters).torque(q, rest, rest, values)


def test_torques_without_gravity_are_named():
    seen = examined((0.0, 0.0, 0.0))
    (finding,) = seen.findings
    assert finding.declared is NO_GRAVITY and finding.severity == "error"
    assert finding.repairs[0].edits[0].value == [0.0, 0.0, 0.0]
    assert not seen.model.gravity.any()


@pytest.mark.parametrize("gravity", [None, (9.81, 0.0, 0.0), (0.0, 0.0, -4.9)])
def test_other_gravity_is_another_fault(gravity):
    assert examined(gravity).findings == ()


@pytest.mark.parametrize("unit", [1e-3, 0.02, 50.0])
def test_no_unit_of_the_torque_hides_gravity(unit):
    """Currents and kilonewton metres hold as much of it as newton metres do."""
    seen, scaled = examined(None), examined(None, unit=unit)
    assert scaled.findings == ()
    whole, same = gravity_shares(seen.model), gravity_shares(scaled.model)
    assert len(whole) > 1 and whole.keys() == same.keys()
    for name, (share, _, _) in whole.items():
        assert share > 0.1 and same[name][0] == pytest.approx(share, rel=0.05)


def test_without_gravity_in_the_description_nothing_is_asked():
    seen = examined(None, described=(0.0, 0.0, 0.0))
    assert seen.findings == () and gravity_shares(seen.model) == {}


def test_without_bodies_in_the_description_nothing_is_asked():
    model = examined(None).model
    nothing = np.zeros_like(model.gravity)
    without = DescribedTorque(lambda: (nothing, nothing))
    assert gravity_shares(replace(model, described=without)) == {}
