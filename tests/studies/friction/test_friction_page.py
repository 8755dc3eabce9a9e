"""Page, tables and command: everything there, escaped, all or nothing."""

import html
import json
import re
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pivident.app.cli import main
from pivident.foundation.errors import PividentError
from pivident.studies.friction.curves import curves_table, render_page, write_friction
from pivident.studies.friction.friction_study import FrictionStudy, joint_friction
from tests.browser import needs_browser, seen_on_a_phone
from tests.planar_log import write_experiment
from tests.studies.friction.made_up import friction_torque
from tests.studies.friction.test_ripple_lines import cosine, found_in, record


@pytest.fixture(scope="module")
def study():
    joint = joint_friction(friction_torque(5, 6000, load_factor=0.25))
    return FrictionStudy("arm", "IDIM-IV", ("run",), (joint,), {"wrist": "it rests"})


@pytest.mark.usefixtures("without_plotly")
def test_page_has_every_finding_and_plot(study):
    text = render_page(study)
    figures = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    assert len(figures) == 7 and all(json.loads(figure)["data"] for figure in figures)
    words = "".join(str(json.loads(figure)["layout"]) for figure in figures)
    assert all(unit in words for unit in ("[N m]", "[rad/s]", "[rad]", "[s]", "[rad/s²]", "[%]"))
    visible = html.unescape(text)
    for finding in study.joints[0].findings:
        assert finding.message in visible
    assert "wrist is left out: it rests." in visible


@pytest.mark.usefixtures("without_plotly")
def test_names_are_escaped(study):
    (joint,) = study.joints
    name = "<script>alert(1)</script>"
    joint = replace(joint, torque=replace(joint.torque, name=name))
    text = render_page(replace(study, robot=name, joints=(joint,), left_out={name: name}))
    assert "<script>alert" not in text and "&lt;script&gt;alert" in text


@pytest.mark.usefixtures("without_plotly")
def test_ripple_has_its_section(study, tmp_path):
    ripple = found_in(record(3, cosine(40.0, 0.1, 1.0), joints=1), lag=0.0)
    (line,) = (line for line in ripple.lines if abs(line.order - 40.0) < 1.0)
    with_ripple = replace(study, ripple=ripple)
    assert str(line) in html.unescape(render_page(with_ripple))
    page = write_friction(with_ripple, tmp_path / "out")
    content = json.loads((page.parent / "friction.json").read_text("utf-8"))
    stored = content["ripple"][0]["lines"][0]
    assert stored["order"] == line.order and stored["interval"] == list(line.interval)


@needs_browser
def test_page_on_a_phone(study, tmp_path):
    seen = seen_on_a_phone(render_page(study), tmp_path)
    assert seen["drawn"] == seen["plots"] == 7


@pytest.mark.usefixtures("without_plotly")
def test_files_agree_and_are_strict(study, tmp_path):
    page = write_friction(study, tmp_path / "out")
    assert page.name == "friction.html"
    names = {p.name for p in page.parent.iterdir()}
    assert names == {"friction.html", "friction.json", "curves.csv", "curves.parquet"}
    content = json.loads((page.parent / "friction.json").read_text("utf-8"))
    (joint,) = content["joints"]
    assert content["schema"] == 1 and joint["torque_unit"] == "N m"
    fit = study.joints[0].fit
    for function, p in zip(joint["functions"], fit.parameters, strict=True):
        assert function["name"] == p.name
        np.testing.assert_allclose(function["value"], p.value)
        np.testing.assert_allclose(function["std"], p.std)
    table = pl.read_parquet(page.parent / "curves.parquet")
    assert table.equals(curves_table(study))
    assert pl.read_csv(page.parent / "curves.csv").height == table.height
    load = table.filter((pl.col("kind") == "function") & (pl.col("name") == "load"))
    assert load["state_unit"].unique().to_list() == ["N m"]
    np.testing.assert_allclose(load["upper"] - load["lower"], 4 * fit["load"].std)
    assert table.filter(pl.col("kind") == "map")["name"].n_unique() == 7


def test_nothing_is_left_half_written(study, tmp_path, monkeypatch):
    monkeypatch.setattr("pivident.studies.friction.curves.render_page", lambda *a: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_friction(study, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    monkeypatch.undo()
    (tmp_path / "file").write_text("")
    with pytest.raises(PividentError):
        write_friction(study, tmp_path / "file" / "out")


@pytest.mark.usefixtures("without_plotly")
def test_command_line(tmp_path, capsys):
    experiment = write_experiment(tmp_path)
    out = tmp_path / "friction"
    assert main(["friction", str(experiment), "--out", str(out), "--method", "ls"]) == 0
    printed = capsys.readouterr().out
    assert "shoulder: " in printed and "elbow: " in printed and "± " in printed
    assert (out / "friction.html").exists() and (out / "curves.csv").exists()
    assert main(["friction", str(tmp_path / "none.toml"), "--out", str(out)]) == 1
    assert main(["friction", str(experiment), "--out", str(out), "--method", "magic"]) == 1
    assert main(["friction", str(experiment), "--out", str(out), "--standstill", "2"]) == 1
    errors = [line for line in capsys.readouterr().err.splitlines() if "error:" in line]
    assert len(errors) == 3 and "none.toml" in errors[0] and "magic" in errors[1]
    assert "between 0 and 1" in errors[2]
