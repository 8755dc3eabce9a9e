"""Blocks of pages whose results are compared with the truth, not only run.

They stand in first_steps.md, friction_laws.md, linear.md and how_to/unknown_controller.md.
"""

import re

import numpy as np

from pivident.estimation.methods import METHODS
from pivident.experiment.experiment import load_experiment
from tests.docs.page_blocks import DOCS, blocks_of
from tests.planar_log import write_log


def blocks(page: str) -> list[str]:
    """The blocks of a page that are run here."""
    found = blocks_of((DOCS / page).read_text(encoding="utf-8"), page)
    return [b.text for b in found if b.mark("run by") == "tests/docs/test_page_examples.py"]


def test_experiment_block_loads_and_describes_the_same_problem(tmp_path):
    (text,) = blocks("first_steps.md")
    write_log(tmp_path / "log.csv")
    path = tmp_path / "my_robot.toml"
    path.write_text(text, encoding="utf-8")
    experiment = load_experiment(path)
    assert tuple(experiment.methods()) == ("ls", "iv-full-rate", "piv")
    assert experiment.problem().recordings[0].samples == 8000


def test_friction_block_chooses_another_law(tmp_path):
    (text,), (friction,) = blocks("first_steps.md"), blocks("friction_laws.md")
    write_log(tmp_path / "log.csv")
    path = tmp_path / "my_robot.toml"
    head, table = re.split(r"^robot = .*\n", text, flags=re.MULTILINE)
    path.write_text(head + friction + table, encoding="utf-8")
    shoulder, elbow = load_experiment(path).robot.joints
    assert str(shoulder.friction) == "fvp max(dq, 0) + fvn min(dq, 0) + fc sign(dq) + off"
    assert "+ fs tanh(γ dq) exp(-|dq/0.05|^2) + fl |load|" in str(elbow.friction)
    assert elbow.friction.slopes[0] == 400.0


def test_block_for_an_unknown_loop_loads(tmp_path):
    (text,) = blocks("how_to/unknown_controller.md")
    path = tmp_path / "unknown.toml"
    path.write_text(text, encoding="utf-8")
    controller = load_experiment(path).content.controller
    assert controller.type == "identify" and controller.reference == "reconstruct"


def test_block_on_linear_models_prints_one(capsys):
    (code,) = blocks("linear.md")
    names: dict = {}
    exec(compile(code, "linear.md", "exec"), names)
    assert "SRIVC" in capsys.readouterr().out
    np.testing.assert_allclose(names["model"].denominator, [1.0, 2.0], rtol=0.03)
    np.testing.assert_allclose(names["model"].numerator, [4.0], rtol=0.03)


def test_every_method_is_in_the_table():
    text = (DOCS / "reference" / "methods.md").read_text(encoding="utf-8")
    for name in METHODS:
        assert f"`{name}`" in text, name
