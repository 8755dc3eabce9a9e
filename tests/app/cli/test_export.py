"""``pivident export``: from an experiment file to each format, and what is refused."""

import ctypes
import gzip
import hashlib
import json
import re
import shutil

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.models.export.c_source import c_compiler
from pivident.models.export.formats import FORMATS
from pivident.models.export.urdf import to_urdf
from pivident.models.exported import random_states
from pivident.models.model_json import read_model
from pivident.models.runnable_model import runnable_model
from pivident.models.stored_model import stored_model
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import read_urdf
from tests.planar_log import EXPERIMENT, write_log

ROBOT = '[robot]\nmodel = "arm.urdf"\ngravity = "-y"\n[output]\nreport = false\n'


def run(*tokens: object) -> int:
    return main([str(token) for token in tokens])


def digest(path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A result of the planar arm, which was read from a URDF."""
    folder = tmp_path_factory.mktemp("export")
    write_log(folder / "log.csv")
    text = to_urdf(runnable_model(load_robot("planar_2r"))).content
    (folder / "arm.urdf").write_bytes(text + b"<!-- a comment that stays -->\n")
    (folder / "arm.toml").write_text(
        EXPERIMENT.replace('robot = "planar_2r"\n', "") + ROBOT, encoding="utf-8"
    )
    assert run("identify", folder / "arm.toml", "--folds", 0, "--out", folder / "result") == 0
    return folder / "result"


@pytest.fixture
def stored(result):
    return stored_model(result)[0]


def test_every_format_is_written_and_loaded_back(result, tmp_path, capsys):
    inputs = [*result.iterdir(), *(p for p in result.parent.iterdir() if p.is_file())]
    before = {path: digest(path) for path in inputs}
    for to in FORMATS:
        capsys.readouterr()
        out = tmp_path / f"model.{to}"
        assert run("export", result, "--to", to, "--out", out) == 0
        text = capsys.readouterr().out
        assert text.startswith(f"Written: {out}") and "PC-IDIM-WLS, physically consistent" in text
        if reason := FORMATS[to].not_loaded:
            assert f"Not loaded back: {reason}" in text
        for size in re.findall(r"largest difference (\S+) N m", text):
            assert float(size) < 1e-9
        count = {"urdf": 2, "latex": 0, "sdf": 0}.get(to, 1)
        assert text.count("Loaded back: ") == count - (to == "c" and c_compiler() is None)
    assert {path: digest(path) for path in inputs} == before


def test_urdf_is_the_original_with_other_inertials(result, stored, tmp_path):
    out = tmp_path / "arm.urdf.gz"
    assert run("export", result, "--to", "urdf", "--out", out) == 0
    text = gzip.decompress(out.read_bytes())
    assert b"<!-- a comment that stays -->" in text
    loaded = read_urdf(out)
    for i, link in enumerate(loaded.links):
        np.testing.assert_allclose(link.inertia, stored.inertial(i), rtol=1e-12, atol=1e-15)
    values = dict(zip((p.name for p in stored.parameters), stored.values, strict=True))
    assert loaded.friction_nominal["fv1"] == pytest.approx(values["fv1"], rel=1e-12)


def test_json_is_the_model(result, stored, tmp_path):
    assert run("export", result, "--to", "json", "--out", tmp_path / "m.json") == 0
    loaded = read_model(tmp_path / "m.json")
    np.testing.assert_array_equal(loaded.values, stored.values)
    content = json.loads((tmp_path / "m.json").read_text("utf-8"))
    assert content["origin"]["identification"] == digest(result / "identification.json")
    assert list(content["origin"]["sources"]) == ["log.csv"]
    assert all(p["interval"] is not None for p in content["parameters"])


def test_numpy_file_computes_the_torque(result, stored, tmp_path):
    assert run("export", result, "--to", "numpy", "--out", tmp_path / "arm.py") == 0
    loaded: dict = {}
    exec((tmp_path / "arm.py").read_text("utf-8"), loaded)
    states = random_states(stored.robot)
    torque = loaded["inverse_dynamics"](*states)
    np.testing.assert_allclose(torque, stored.torque(*states), rtol=0, atol=1e-10)


@pytest.mark.skipif(c_compiler() is None, reason="there is no C compiler here")
def test_c_file_compiles_as_its_header_says(result, stored, tmp_path):
    import subprocess

    assert run("export", result, "--to", "c", "--out", tmp_path / "arm.c") == 0
    (tmp_path / "use.c").write_text(
        '#include "arm.h"\nvoid use(const double *x, double *tau);\n'
        "void use(const double *x, double *tau)"
        " { arm_inverse_dynamics(x, x + 2, x + 4, tau); }\n"
    )
    command = [c_compiler(), "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared"]
    command += ["-fPIC", "-o", "use.so", "use.c", "arm.c", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120)
    library = ctypes.CDLL(str(tmp_path / "use.so"))
    states = random_states(stored.robot, 1)
    given = (ctypes.c_double * 6)(*np.concatenate([s[0] for s in states]))
    tau = (ctypes.c_double * 2)()
    library.use(given, tau)
    np.testing.assert_allclose(list(tau), stored.torque(*states)[0], rtol=1e-10)


def test_free_estimate_and_no_check(result, tmp_path, capsys):
    out = tmp_path / "free.json"
    assert run("export", result, "--to", "json", "--out", out, "--free", "--no-check") == 0
    text = capsys.readouterr().out
    assert "IDIM-WLS, not made physically consistent" in text and "Loaded back" not in text
    assert not read_model(out).consistent


@pytest.mark.parametrize("to", ["urdf", "mjcf", "sdf", "c", "numpy", "latex"])
def test_a_file_says_what_is_in_it_and_which_use_was_rejected(result, tmp_path, to):
    """Estimate and consistent set, also by way of `pivident consistent`."""
    folder = tmp_path / "result"
    shutil.copytree(result, folder)
    why = "no machine has these parameters (fit error 14 % -- 50 %)"
    verdict = json.loads((folder / "verdict.json").read_text("utf-8"))
    verdict["uses"]["simulation"] |= {"answer": "no", "why": why}
    (folder / "verdict.json").write_text(json.dumps(verdict | {"in_spite_of": ["A sign."]}))
    assert run("consistent", folder, "--out", tmp_path / "set") == 0
    sources = [(folder, "--free"), (folder,), (tmp_path / "set" / "consistent.json",)]
    texts = []
    for source in sources[to == "mjcf" :]:  # MuJoCo refuses the estimate of this log
        out = tmp_path / f"model.{to}"
        assert run("export", *source, "--to", to, "--out", out, "--no-check") == 0
        comments = re.sub(r"(\W*\n\W*)|(- -)", " ", out.read_text("utf-8").replace("- -", "--"))
        texts.append(re.sub(r"\s+", " ", comments))
    for text in texts:
        assert "rejects it for simulation" in text and "Identified in spite of this: A sign" in text
    if to != "latex":
        assert ("the estimate, not made physically consistent" in texts[0]) == (to != "mjcf")
        assert all("the consistent set, which a machine can have" in t for t in texts[-2:])


@pytest.mark.parametrize("name", ["identification.json", "../arm.urdf", "../log.csv"])
def test_inputs_are_not_overwritten(result, capsys, name):
    target = result / name
    before = digest(target)
    assert run("export", result, "--to", "urdf", "--out", target) == 1
    assert "made from, which must not change" in capsys.readouterr().err
    assert digest(target) == before


def test_the_robot_of_a_copied_project_is_not_overwritten(result, tmp_path, capsys):
    """The estimate names the URDF of the project that was copied, which is still there."""
    copy = tmp_path / "copy"
    shutil.copytree(result.parent, copy)
    before = digest(copy / "arm.urdf")
    assert run("export", copy / result.name, "--to", "urdf", "--out", copy / "arm.urdf") == 1
    assert "made from, which must not change" in capsys.readouterr().err
    assert digest(copy / "arm.urdf") == before


def test_link_to_an_input_is_an_input(result, tmp_path, capsys):
    (tmp_path / "link.urdf").symlink_to(result.parent / "arm.urdf")
    assert run("export", result, "--to", "urdf", "--out", tmp_path / "link.urdf") == 1
    assert "must not change" in capsys.readouterr().err


def test_header_that_would_replace_an_input_is_refused(result, tmp_path, capsys):
    (tmp_path / "arm.h").symlink_to(result / "identification.json")
    assert run("export", result, "--to", "c", "--out", tmp_path / "arm.c") == 1
    assert "must not change" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["arm.h", "ARM.H"])
def test_source_and_header_need_two_names(result, tmp_path, capsys, name):
    assert run("export", result, "--to", "c", "--out", tmp_path / name) == 1
    assert "written beside it; give --out another ending" in refused(capsys)
    assert list(tmp_path.iterdir()) == []


def refused(capsys) -> str:
    lines = capsys.readouterr().err.strip().splitlines()
    assert lines[-1].startswith("error:") and not any("Traceback" in line for line in lines)
    return lines[-1]


def test_what_cannot_be_is_refused_in_one_line(result, tmp_path, capsys):
    cases = [
        ((result, "--to", "json", "--robot", "a.urdf", "--out", tmp_path / "a"), 1, "--robot is"),
        ((result, "--to", "word", "--out", tmp_path / "a"), 2, "word"),
        ((result, "--to", "json", "--out", tmp_path), 1, "is a folder; name a file"),
        ((tmp_path, "--to", "json", "--out", tmp_path / "a"), 1, "holds no identification.json"),
        ((result / "verdict.json", "--to", "json", "--out", tmp_path / "a"), 1, "not an identific"),
        ((result, "--to", "json", "--out", result / "verdict.json" / "a"), 1, "is a file; choose"),
    ]
    for tokens, code, message in cases:
        assert run("export", *tokens) == code, tokens
        assert message in refused(capsys)
    assert list(tmp_path.iterdir()) == []


def test_changed_urdf_is_named(result, tmp_path, capsys):
    original = result.parent / "arm.urdf"
    before = original.read_bytes()
    out = tmp_path / "new.urdf"
    try:
        original.write_bytes(before.replace(b"stays", b"moved"))
        assert run("export", result, "--to", "urdf", "--out", out) == 1
        assert "has changed since the robot was identified" in refused(capsys)
        assert not out.exists()
        assert run("export", result, "--to", "urdf", "--out", out, "--robot", original) == 0
        assert "is not the file that was identified" in capsys.readouterr().out
    finally:
        original.write_bytes(before)


def test_file_that_says_something_else_is_not_written(result, tmp_path, capsys, monkeypatch):
    from pivident.models.export import formats
    from pivident.models.exported import Verification

    wrong = Verification("an engine", largest=1.0, relative=0.1, states=5)
    monkeypatch.setattr(formats, "verify_export", lambda *a, **k: (wrong,))
    assert run("export", result, "--to", "json", "--out", tmp_path / "m.json") == 1
    assert "does not match the model" in refused(capsys)
    assert list(tmp_path.iterdir()) == []
