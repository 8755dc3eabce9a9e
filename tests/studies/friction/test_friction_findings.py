"""What was planted is seen, with numbers inside their intervals; what was not is not."""

from functools import cache

import numpy as np
import pytest

from pivident.foundation.errors import IdentificationError
from pivident.studies.friction.effects import headline
from pivident.studies.friction.friction_study import joint_friction
from tests.studies.friction.made_up import friction_torque


def seen(joint):
    return {f.kind: f for f in joint.findings}


@cache
def plain(seed):
    return joint_friction(friction_torque(seed))


def test_plain_friction_shows_nothing():
    clear = []
    for seed in range(4):
        clear += [f.kind for f in plain(seed).findings if f.clear and f.brief]
    assert len(clear) <= 1, clear  # 24 findings


def test_plain_friction_is_said_to_be_plain():
    joint = plain(1)
    assert (
        headline(joint.findings) == "Viscous and Coulomb friction describe all that is seen here."
    )
    found = seen(joint)
    assert abs(found["prediction"].quantity.value) < 10.0


def test_asymmetry():
    torque = friction_torque(2, backwards=lambda v: 3.6 + 1.2 * v)
    found = seen(joint_friction(torque))["asymmetry"]
    assert found.clear and "offset" in found.terms
    speed = float(found.brief.split(" at ")[1].split()[0])
    truth = -0.6 / (3.3 + 1.2 * speed) * 100
    shown = float(found.brief.split("backwards ")[1].split()[0])
    assert shown == pytest.approx(truth, abs=1.5 * found.evidence["two_sigma"].value + 1.0)


def test_stribeck():
    torque = friction_torque(
        3, forwards=lambda v: 3 + 1.0 * v + 2.5 * np.exp(-((v / 0.25) ** 2)), std=0.2
    )
    found = seen(joint_friction(torque))["stribeck"]
    assert found.clear and found.terms == "Stribeck"
    assert found.quantity.value == pytest.approx(2.0, abs=0.6)


def test_degressive_viscous_friction():
    torque = friction_torque(4, forwards=lambda v: 3 + 3.0 * v - 0.45 * v**2)
    found = seen(joint_friction(torque))["bend"]
    assert found.clear and found.quantity.value < 0 and "degressive" in found.terms
    top = np.abs(torque.dq).max()
    assert found.quantity.value == pytest.approx(-0.45 * 0.9 * top, rel=0.3)


def test_load():
    torque = friction_torque(5, load_factor=0.25)
    joint = joint_friction(torque)
    found = seen(joint)["load"]
    assert found.clear and found.terms == "load-dependent friction"
    reach = np.quantile(np.abs(torque.load[torque.moving]), 0.9)
    assert found.quantity.value == pytest.approx(
        25 * reach / torque.level, abs=1.5 * found.evidence["two_sigma"].value
    )


def test_ripple_and_its_period():
    torque = friction_torque(6, position=lambda q: 0.4 * np.sin(21 * q + 1.0))
    joint = joint_friction(torque)
    found = seen(joint)["position"]
    assert found.clear and found.terms == "position ripple"
    assert "21.0 times per turn" in found.message
    assert found.quantity.value == pytest.approx(0.8, abs=0.3)
    gain, std = joint.held_out.full.gain(joint.held_out.constant)
    assert gain > 5 * std > 0


def test_drift():
    torque = friction_torque(7, drift=-0.8)
    found = seen(joint_friction(torque))["drift"]
    assert found.clear
    assert found.quantity.value == pytest.approx(
        -80 / torque.level, abs=1.5 * found.evidence["two_sigma"].value
    )


def test_a_joint_that_moves_one_way_is_refused():
    torque = friction_torque(8)
    torque.moving[torque.dq < 0] = False
    with pytest.raises(IdentificationError, match="never moves backwards"):
        joint_friction(torque)
