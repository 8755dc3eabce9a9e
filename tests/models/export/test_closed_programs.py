"""C and NumPy files of mechanisms with closed loops: their functions against the kernels."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.models.export import c_source
from pivident.models.export.c_source import c_compiler, compiled, to_c, verify_c
from pivident.models.export.numpy_function import to_numpy, verify_numpy
from pivident.models.exported import random_states
from pivident.robot.friction import FrictionLaw, spring, viscous
from tests.dynamics.closed.mechanisms import five_bar
from tests.models.export.robots import with_values
from tests.models.symbolic.mechanisms import GALLERY, closed_states, mechanism

needs_compiler = pytest.mark.skipif(c_compiler() is None, reason="there is no C compiler here")

#: With passive positions in closed form, by Newton's method, and by proportions alone.
EACH_WAY = ("five_bar", "delta", "scara")


@pytest.fixture
def strict(monkeypatch):
    """Warnings of the compiler are errors."""
    monkeypatch.setattr(c_source, "FLAGS", (*c_source.FLAGS, "-Wall", "-Wextra", "-Werror"))


@needs_compiler
@pytest.mark.parametrize("name", [*GALLERY, "geared five bar"])
def test_c_file(name, strict):
    model = with_values(mechanism(name))
    check = verify_c(to_c(model), model)
    assert check.agrees, str(check)


@pytest.mark.parametrize("name", [*EACH_WAY, "geared five bar"])
def test_numpy_file(name):
    model = with_values(mechanism(name))
    check = verify_numpy(to_numpy(model), model)
    assert check.agrees, str(check)


def test_springs_of_passive_joints_that_turn_far():
    """Half a turn beyond the posture of the description a spring is wound on, not back."""
    robot = five_bar(kind="axis", law=FrictionLaw((viscous(), spring())))
    model = with_values(robot)
    elbow = [ClosedChains(robot).start(q).q[1] for q in random_states(robot)[0]]
    assert np.abs(np.array(elbow) - robot.constraints.posture[1]).max() > np.pi
    check = verify_numpy(to_numpy(model), model)
    assert check.agrees, str(check)


@needs_compiler
def test_a_wrong_number_would_be_seen():
    model = with_values(mechanism("delta"))
    other = replace(model, values=model.values * (1.0 + 1e-6))
    assert not verify_c(to_c(other), model).agrees
    assert not verify_numpy(to_numpy(other), model).agrees


@needs_compiler
def test_a_controller_hands_the_posture_on(tmp_path):
    """States one after the other, each from the posture before; the one that is open is NaN."""
    model = with_values(mechanism("delta"))
    exported = to_c(model, "arm")
    assert "extern const double arm_closed_posture[12];" in exported.further["arm.h"].decode()
    library = compiled(exported, tmp_path, c_compiler())
    pointer = ctypes.POINTER(ctypes.c_double)
    posture = np.array((ctypes.c_double * 12).in_dll(library, "arm_closed_posture"))
    q, dq, ddq = closed_states(model.robot, 5, 3)
    q[2] = 3.0  # legs that do not reach one another
    tau = np.empty(q.shape)
    for k in range(len(q)):
        arrays = (q[k], dq[k], ddq[k], posture, tau[k])
        library.arm_inverse_dynamics(*(x.ctypes.data_as(pointer) for x in arrays))
    closed = [0, 1, 3, 4]
    expected = model.torque(q[closed], dq[closed], ddq[closed])
    np.testing.assert_allclose(tau[closed], expected, rtol=1e-9, atol=1e-9)
    assert np.isnan(tau[2]).all()


def test_the_header_names_what_moves_along():
    model = with_values(mechanism("five_bar"))
    for exported in (to_c(model), to_numpy(model)):
        assert "They move left_elbow, right_elbow along" in exported.text
        assert "NaN where the loops do not close" in exported.text
    assert "They move" not in to_numpy(with_values(mechanism("five_bar").tree)).text
