"""C and NumPy files: compiled or executed, and compared with the model."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.foundation.errors import ExportError
from pivident.models.export import c_source
from pivident.models.export.c_source import c_compiler, to_c, verify_c
from pivident.models.export.numpy_function import (
    friction_in_groups,
    inner_columns,
    to_numpy,
    verify_numpy,
)
from pivident.models.exported import random_states
from pivident.models.runnable_model import runnable_model
from pivident.robot.friction import FrictionLaw, coulomb, load_dependent, lugre, ripple, viscous
from pivident.robot.gallery import load_robot
from tests.dynamics.friction_laws import LAWS
from tests.robot.random_robots import random_robot
from tests.synthetic_identification import synthetic_identification

needs_compiler = pytest.mark.skipif(c_compiler() is None, reason="there is no C compiler here")


def random_model(robot, seed=0):
    model = runnable_model(robot)
    rng = np.random.default_rng(seed)
    return replace(model, values=rng.uniform(0.1, 0.9, model.values.size))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_numpy_file_of_random_trees(seed):
    model = random_model(random_robot(seed, largest=4), seed)
    check = verify_numpy(to_numpy(model), model)
    assert check.agrees, str(check)


@needs_compiler
@pytest.mark.parametrize("seed", [2, 5, 6, 11])
def test_c_file_of_random_trees(seed):
    model = random_model(random_robot(seed, largest=3), seed)
    check = verify_c(to_c(model), model)
    assert check.agrees, str(check)


@needs_compiler
@pytest.mark.parametrize("robot", ["staubli_tx40", "emps"])
def test_gallery_in_c_and_numpy(robot):
    model = runnable_model(synthetic_identification(robot_name=robot))
    for check in (verify_c(to_c(model), model), verify_numpy(to_numpy(model), model)):
        assert check.agrees, str(check)


@pytest.mark.parametrize("law", LAWS)
def test_every_friction_law_in_numpy(law):
    robot = load_robot("planar_2r").with_friction(FrictionLaw(LAWS[law]))
    model = random_model(robot)
    check = verify_numpy(to_numpy(model), model)
    assert check.agrees, str(check)


def test_comparison_would_see_a_wrong_number():
    model = random_model(load_robot("planar_2r"))
    other = replace(model, values=model.values * (1.0 + 1e-6))
    assert not verify_numpy(to_numpy(other), model).agrees


def test_numpy_file_stands_alone(tmp_path):
    model = random_model(load_robot("planar_2r"))
    (tmp_path / "arm.py").write_bytes(to_numpy(model).content)
    q, dq, ddq = random_states(model.robot, 3)
    code = (
        "import sys, numpy as np, arm; "
        f"x = np.array({[q[0].tolist(), dq[0].tolist(), ddq[0].tolist()]}); "
        "print(*arm.inverse_dynamics(*x)); "
        "print(sorted({m.split('.')[0] for m in sys.modules} & {'pivident', 'scipy', 'numba'}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    torque, modules = done.stdout.splitlines()
    expected = model.torque(q[:1], dq[:1], ddq[:1])[0]
    np.testing.assert_allclose([float(x) for x in torque.split()], expected, rtol=1e-12)
    assert modules == "[]"


def test_friction_with_memory_is_an_argument_and_said():
    robot = load_robot("planar_2r").with_friction(
        {"elbow": FrictionLaw((viscous(), *lugre(1e-3, 0.3, 0.1), load_dependent()))}
    )
    model = random_model(robot)
    exported = to_numpy(model)
    assert "friction of 'elbow' has a memory" in exported.differences[0]
    assert verify_numpy(exported, model).agrees
    q, dq, ddq = random_states(robot, 5)
    memory, inner = inner_columns(model, q, dq, ddq)
    assert (memory.shape, inner.shape) == ((5, 2), (5, 3))


def test_ripple_of_order_one_is_not_gravity():
    robot = load_robot("planar_2r").with_friction(FrictionLaw((coulomb(), *ripple(1.0, "_a"))))
    model = random_model(robot)
    assert friction_in_groups(model.base)
    assert not friction_in_groups(random_model(load_robot("planar_2r")).base)
    check = verify_numpy(to_numpy(model), model)
    assert check.agrees, str(check)


def hostile_robot():
    robot = random_robot(3)
    name = 'x*/ int main; /* ??/ """ \\ exit() é'
    joints = list(robot.joints)
    joints[0] = replace(joints[0], name=name)
    return replace(robot, name=name, joints=tuple(joints))


@needs_compiler
def test_hostile_names_stay_in_comments():
    model = random_model(hostile_robot())
    texts = {'x*/ int main; /* ??/ """ \\ \n exit()\u202e': "\n*/"}  # files may hold any name
    model = replace(model, origin=replace(model.origin, method="\n??/", sources=texts))
    assert verify_numpy(to_numpy(model), model).agrees
    assert verify_c(to_c(model, "for; a/b"), model).agrees


def test_name_of_the_file_becomes_the_prefix():
    exported = to_c(random_model(load_robot("planar_2r")), "my-arm 2")
    assert list(exported.further) == ["my_arm_2.h"]
    assert '#include "my_arm_2.h"' in exported.text
    header = exported.further["my_arm_2.h"].decode()
    for name in ("inverse_dynamics", "gravity", "mass_matrix", "regressor"):
        assert f"void my_arm_2_{name}(" in header
    assert "main(" not in exported.text


def test_without_a_compiler_it_is_said(monkeypatch):
    model = random_model(load_robot("planar_2r"))
    monkeypatch.setattr(c_source, "c_compiler", lambda: None)
    assert "no C compiler" in verify_c(to_c(model), model).skipped


@needs_compiler
def test_compiler_warns_of_nothing(tmp_path, monkeypatch):
    strict = (*c_source.FLAGS, "-Wall", "-Wextra", "-Werror")
    monkeypatch.setattr(c_source, "FLAGS", strict)
    for robot in (hostile_robot(), load_robot("staubli_tx40")):
        model = random_model(robot)
        assert verify_c(to_c(model), model).agrees


@needs_compiler
@pytest.mark.parametrize("mark", ["???/", "??/", "????/", "?"])
def test_question_marks_make_no_trigraph(mark):
    exported = to_c(random_model(replace(load_robot("planar_2r"), name=f"arm{mark}")))
    for content in (exported.content, *exported.further.values()):
        assert b"??" not in content


@needs_compiler
def test_a_warning_of_the_compiler_is_no_obstacle():
    model = random_model(load_robot("planar_2r"))
    exported = to_c(model)
    untidy = replace(exported, content=exported.content + b"\nstatic int left_over;\n")
    assert verify_c(untidy, model).agrees


def test_python_file_runs_in_another_process():
    model = random_model(load_robot("planar_2r"))
    exported = to_numpy(model)
    marked = replace(exported, content=exported.content + b"import sys; sys.marked = True\n")
    assert verify_numpy(marked, model).agrees and not hasattr(sys, "marked")
    broken = replace(exported, content=exported.content + b"raise RuntimeError('spoiled')\n")
    with pytest.raises(ExportError, match=r"does not run: .*spoiled"):
        verify_numpy(broken, model)


@needs_compiler
def test_file_that_does_not_compile_is_an_error():
    model = random_model(load_robot("planar_2r"))
    broken = replace(to_c(model), content=b"int x = y;")
    with pytest.raises(ExportError, match=r"does not compile with .*-std=c99"):
        verify_c(broken, model)
