"""Scripts of examples/python: short, and with the results that they promise.

`tests/docs/test_typed.py` checks their types.
"""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "examples" / "python"
#: Lines of a script at most.
MAX_LINES = 40


def main(name: str):
    """What the script returns."""
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main()


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_scripts_are_short_and_listed(path: Path):
    assert len(path.read_text("utf-8").splitlines()) <= MAX_LINES
    assert f"python/{path.name}" in (REPOSITORY / "examples/README.md").read_text("utf-8")


def test_own_control_law():
    least_squares, piv, truth = main("own_control_law")
    true = np.array([truth[name] for name in piv.names])
    assert (np.abs(piv.theta - true) < 4.0 * piv.std).all()
    assert np.abs(piv.value("zz1r") - truth["zz1r"]) < 0.02 * truth["zz1r"]
    assert least_squares.names == piv.names


def test_own_friction():
    found, usual, c = main("own_friction")
    for name, true in {"gear1": 4.0, "gear2": 1.5, "fv1": 3.0, "fv2": 1.0}.items():
        assert abs(found.value(name) - true) < 4.0 * found.std[found.names.index(name)]
    # Coulomb friction takes what the gear's load adds for its own
    assert usual.value("fc1") > 4.3
    assert b"static double gear(double dq, double load)" in c


def test_to_and_from_pinocchio():
    pytest.importorskip("pinocchio")
    pytest.importorskip("mujoco")
    own, pinocchio, mujoco = main("to_and_from_pinocchio")
    np.testing.assert_allclose(pinocchio, own, rtol=0, atol=1e-10)
    np.testing.assert_allclose(mujoco, own, rtol=0, atol=1e-10)


def test_linear_models():
    white, coloured, smoothed, acceleration = main("linear_models")
    for model in (white, coloured):
        error = np.abs(model.theta - [8.0, 25.0, 50.0])
        assert (error < 4.0 * np.sqrt(np.diag(model.covariance))).all()
    inside = slice(smoothed.edge, -smoothed.edge)
    assert np.abs(smoothed.ddq - acceleration)[inside].max() < 0.05 * np.abs(acceleration).max()


def test_feed_forward():
    single, many, of_c = main("feed_forward")
    np.testing.assert_allclose(single, many, rtol=0, atol=1e-11)
    np.testing.assert_allclose(of_c, many, rtol=0, atol=1e-9)
