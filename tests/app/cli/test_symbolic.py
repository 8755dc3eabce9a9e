"""The command ``pivident symbolic``: tables, texts, files and refusals."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest

from pivident.app.cli.app import main
from pivident.app.cli.console import DONE, WRONG_INPUT
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.models.export.c_source import c_compiler
from pivident.models.symbolic.robot_models import model_files, symbolic_models
from pivident.robot.gallery import load_robot
from tests.models.symbolic.robots import states


def test_operations_are_printed(capsys):
    assert main(["symbolic", "staubli_tx40"]) == DONE
    text = capsys.readouterr().out
    assert "Operations for one state of Stäubli TX40" in text
    row = next(line for line in text.splitlines() if "inverse_model" in line)
    assert int(row.split()[1]) <= 290 and int(row.split()[2]) <= 270


def test_groups_are_printed(capsys):
    assert main(["symbolic", "planar_2r", "--what", "base"]) == DONE
    assert "zz1r = zz1 + ia1 + d2²·m2" in capsys.readouterr().out


def test_files_are_written_and_run(tmp_path, capsys):
    folder = tmp_path / "models"
    assert main(["symbolic", "planar_2r", "--out", str(folder)]) == DONE
    names = {path.name for path in folder.iterdir()}
    stem = "planar_2r"
    assert names == {f"{stem}{end}" for end in (".py", ".c", ".h", ".tex", "_sympy.py")}
    namespace: dict = {}
    exec((folder / "planar_2r.py").read_text("utf-8"), namespace)
    robot = load_robot("planar_2r")
    base = base_parameters(robot)
    q, dq, ddq = states(robot, 6)
    standard = nominal_values(robot, standard_parameters(robot))
    theta = namespace["base_parameters"](standard)
    np.testing.assert_allclose(theta, base.values(standard), rtol=1e-12, atol=1e-12)
    expected = Regressor.build(robot, base.parameters).torque(q, dq, ddq, theta)
    tau = namespace["inverse_model"](q, dq, ddq, theta)
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-11)
    parts = namespace["gravity_vector"](q, theta) + namespace["coriolis_vector"](q, dq, theta)
    inertial = np.einsum("sij,sj->si", namespace["mass_matrix"](q, theta), ddq)
    phi = namespace["observation_matrix"](q, dq, ddq)
    links = [p.is_inertial or p.stem == "ia" for p in base.parameters]
    np.testing.assert_allclose(parts + inertial, phi[:, :, links] @ theta[links], atol=1e-11)


def test_a_mechanism_with_closed_loops(tmp_path, capsys):
    """Groups over the loops, the cost of Newton's method, files of every language."""
    assert main(["symbolic", "delta", "--what", "base"]) == DONE
    text = capsys.readouterr().out
    assert "2.77778 yy[swing_1]" in text and "Without effect on any torque:" in text
    folder = tmp_path / "models"
    assert main(["symbolic", "delta", "--out", str(folder), "--values"]) == DONE
    assert "closing_step" in capsys.readouterr().out
    assert len(list(folder.iterdir())) == 5
    namespace: dict = {}
    exec((folder / "delta.py").read_text("utf-8"), namespace)
    robot = load_robot("delta")
    parameters = standard_parameters(robot)
    q = np.radians([[-30.0, -25.0, -35.0]])
    dq, ddq = np.array([[1.0, -0.5, 0.3]]), np.array([[3.0, 1.0, -2.0]])
    values = nominal_values(robot, parameters)
    expected = regressor_of(robot, parameters).torque(q, dq, ddq, values)
    np.testing.assert_allclose(namespace["inverse_model"](q, dq, ddq), expected, atol=1e-9)


@pytest.mark.skipif(c_compiler() is None, reason="there is no C compiler here")
def test_groups_of_a_robot_on_a_floating_base(capsys):
    assert main(["symbolic", "quadruped", "--what", "base"]) == DONE
    assert "mr[trunk] = m[trunk] + m[front_left_abduction] + m[front_left_hip]" in (
        capsys.readouterr().out
    )


def test_functions_of_two_robots_go_into_one_program(tmp_path):
    for robot in ("planar_2r", "emps"):
        assert main(["symbolic", robot, "--to", "c", "--out", str(tmp_path)]) == DONE
    (tmp_path / "both.c").write_text(
        '#include "emps.h"\n#include "planar_2r.h"\n'
        "void *both[] = {(void *)planar_2r_inverse_model, (void *)emps_inverse_model};\n"
    )
    command = [c_compiler(), "-shared", "-fPIC", "-o", "both.so"]
    command += ["both.c", "emps.c", "planar_2r.c", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120)


def test_title_of_a_generated_function_is_one_line(tmp_path):
    robot = replace(load_robot("planar_2r"), name='a???/ """ */')
    files = model_files(robot, symbolic_models(robot, ["gravity"]), ["python", "c"])
    namespace: dict = {}
    exec(next(text for name, text in files.items() if name.endswith(".py")), namespace)
    assert namespace["gravity_vector"](np.zeros(2), np.zeros(len(base_parameters(robot)))).size == 2
    assert not any("??" in text for name, text in files.items() if not name.endswith(".py"))


def test_numbers_in_the_place_of_parameters(capsys):
    arguments = ["symbolic", "planar_2r", "--what", "inverse", "--to", "python", "--values"]
    for kind in ("base", "standard"):
        assert main([*arguments, "--parameters", kind]) == DONE
        namespace: dict = {}
        exec(capsys.readouterr().out, namespace)
        robot = load_robot("planar_2r")
        parameters = standard_parameters(robot)
        q, dq, ddq = states(robot, 6)
        tau = namespace["inverse_model"](q, dq, ddq)
        theta = nominal_values(robot, parameters)
        expected = Regressor.build(robot, parameters).torque(q, dq, ddq, theta)
        np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["planar_2r", "--what", "inverze"], "did you mean 'inverse'?"),
        (["planar_2r", "--to", "fortran"], "there is no 'fortran'"),
        (["planar_2r", "--to", "c,python"], "give a folder"),
        (["planar_2r", "--what", ","], "names nothing; choose from inverse"),
        (["no_such_robot"], "no_such_robot"),
        (["planar_2r", "--what", "closure"], "has no closed loops"),
    ],
)
def test_wrong_choices_are_refused(arguments, message, capsys):
    assert main(["symbolic", *arguments]) == WRONG_INPUT
    assert message in capsys.readouterr().err


def test_values_need_a_robot_that_has_some(tmp_path, capsys):
    path = tmp_path / "bare.toml"
    path.write_text('name = "bare"\n[[joints]]\nname = "a"\n', encoding="utf-8")
    assert main(["symbolic", str(path), "--values"]) == WRONG_INPUT
    assert "has no nominal parameter values; leave out --values" in capsys.readouterr().err
    folder = tmp_path / "taken"
    folder.write_text("a file", encoding="utf-8")
    assert main(["symbolic", "planar_2r", "--out", str(folder)]) == WRONG_INPUT
    assert "is a file" in capsys.readouterr().err
