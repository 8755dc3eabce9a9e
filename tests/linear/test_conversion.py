"""To scipy and python-control and back; the front door."""

import subprocess
import sys

import numpy as np
import pytest
from scipy import signal

import pivident.linear
from pivident.foundation.errors import IdentificationError
from pivident.linear.conversion import from_control, from_scipy

FREQUENCY = np.geomspace(0.01, 4.0, 30)


@pytest.mark.parametrize("dt", [None, 0.1])
def test_scipy_and_back(dt):
    system = signal.TransferFunction(
        [2.0, 1.0], [2.0, 0.6, 1.0], **({} if dt is None else {"dt": dt})
    )
    model = from_scipy(system, 0.1)
    omega = 2 * np.pi * FREQUENCY
    at = 1j * omega if dt is None else np.exp(1j * omega * dt)
    expected = np.polyval(system.num, at) / np.polyval(system.den, at)
    assert np.allclose(model.response(FREQUENCY), expected)
    assert not model.covariance.any()
    assert np.allclose(from_scipy(model.to_scipy(), 0.1).theta, model.theta)


def test_simulation_is_that_of_scipy():
    system = signal.TransferFunction([1.0, 0.5], [1.0, -1.5, 0.7], dt=0.1)
    u = np.random.default_rng(0).standard_normal(50)
    assert np.allclose(from_scipy(system).simulate(u), signal.dlsim(system, u)[1][:, 0])


def test_state_space_and_zeros_and_poles():
    system = signal.ZerosPolesGain([-1.0], [-2.0, -3.0], 5.0)
    for form in (system, system.to_ss()):
        assert np.allclose(np.sort(from_scipy(form, 0.1).poles[0].real), [-3, -2])


def test_python_control_and_back():
    control = pytest.importorskip("control")
    model = from_control(control.tf([1.0, 2.0], [1.0, 0.5, 4.0]), 0.1)
    assert np.allclose(from_control(model.to_control(), 0.1).theta, model.theta)
    several = from_control(control.tf([[[1.0], [2.0]]], [[[1, -0.5], [1, -0.2]]], 0.1))
    assert not several.common
    assert several.names == ("a1_u1", "a1_u2", "b0_u1", "b1_u1", "b0_u2", "b1_u2")
    u = np.random.default_rng(0).standard_normal((40, 2))
    expected = signal.lfilter([0, 1], [1, -0.5], u[:, 0]) + signal.lfilter(
        [0, 2], [1, -0.2], u[:, 1]
    )
    assert np.allclose(several.simulate(u), expected)


def test_periods_are_checked():
    with pytest.raises(IdentificationError, match="give dt"):
        from_scipy(signal.TransferFunction([1], [1, 1]))
    with pytest.raises(IdentificationError, match="sampling period"):
        from_scipy(signal.TransferFunction([1], [1, 0.5], dt=0.1), 0.2)
    with pytest.raises(IdentificationError, match="proper"):
        from_scipy(signal.TransferFunction([1, 1, 1], [1, 1]), 0.1)


def test_front_door_is_light():
    code = (
        "import sys, pivident.linear; "
        "print([m for m in ('numpy', 'scipy', 'numba', 'plotly') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert out.stdout.strip() == "[]"


def test_every_name_of_the_front_door_exists():
    for name in pivident.linear.__all__:
        assert callable(getattr(pivident.linear, name)), name
    assert set(pivident.linear.__all__) == set(dir(pivident.linear))
    assert not hasattr(pivident.linear, "arxx")


def test_functions_are_not_hidden_by_their_modules():
    code = (
        "import pivident.linear.sriv, pivident.linear.arx\n"
        "from pivident.linear import arx, sriv\n"
        "print(arx.__name__, callable(sriv))"
    )
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert out.stdout.split() == ["arx", "True"]
