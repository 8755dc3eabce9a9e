import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from pivident.foundation.text.identifiers import one_line
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.export.formats import export_model
from pivident.models.export.latex import latex_group, latex_number, latex_unit, to_latex
from pivident.models.runnable_model import Origin, runnable_model
from pivident.robot.gallery import load_robot
from tests.robot.random_robots import random_robot
from tests.synthetic_identification import synthetic_identification


def cells(text: str, table: int) -> list[list[str]]:
    """Rows of a table's body."""
    body = text.split(r"\begin{longtable}")[table + 1].split(r"\end{longtable}")[0]
    rows = body.split(r"\endfoot")[1].strip().splitlines()
    return [row.removesuffix(r" \\").split(" & ") for row in rows]


def test_every_base_parameter_has_estimate_spread_and_consistent_value():
    model = runnable_model(make_consistent(synthetic_identification()), intervals=True)
    text = to_latex(model).text
    rows = cells(text, 0)
    assert len(rows) == len(model.base) and all(len(row) == 6 for row in rows)
    for row, value, std in zip(rows, model.estimate.theta, model.estimate.std, strict=True):
        estimate, spread = (number(cell) for cell in row[1:3])
        assert estimate == pytest.approx(value, abs=0.2 * std)
        assert spread == pytest.approx(2.0 * std, rel=0.06)
    standard = cells(text, 1)
    assert len(standard) == len(model.parameters) and all(len(row) == 5 for row in standard)
    for row, value in zip(standard, model.values, strict=True):
        assert number(row[2]) == pytest.approx(value, rel=1e-4, abs=1e-12)


def number(cell: str) -> float:
    mantissa, _, power = cell.strip("$").partition(r" \cdot 10^{")
    return float(mantissa) * 10.0 ** int(power.strip("}") or 0)


def test_standard_parameters_of_a_mechanism_stand_beside_their_links():
    model = runnable_model(load_robot("five_bar"))
    rows = cells(export_model(model, "latex").text, 1)
    assert len(rows) == len(model.parameters)
    links = [row[0].replace("\\", "") for row in rows if row[0]]
    assert links == ["left_crank", "left_rod", "right_crank", "right_rod"]


def test_parameters_that_were_left_out_are_not_in_the_table():
    free = synthetic_identification()
    part = replace(
        free,
        parameters=free.parameters[:3],
        names=free.names[:3],
        expressions=free.expressions[:3],
        judged=None,
        theta=free.theta[:3],
        covariance=free.covariance[:3, :3],
        robust_covariance=free.robust_covariance[:3, :3],
    )
    assert len(cells(to_latex(runnable_model(part)).text, 0)) == 3


@pytest.mark.parametrize(
    ("text", "latex"),
    [
        ("1.2e-07", r"$1.2 \cdot 10^{-7}$"),
        ("-0.5", "$-0.5$"),
        ("–", "--"),
        ("∞", r"$\infty$"),
        ("-∞", r"$-\infty$"),
        ("fixed", "fixed"),
    ],
)
def test_numbers(text, latex):
    assert latex_number(text) == latex


@pytest.mark.parametrize(
    ("unit", "latex"),
    [
        ("kg m²", r"$\mathrm{kg\,m^{2}}$"),
        ("N m s/rad", r"$\mathrm{N\,m\,s/rad}$"),
        ("N m (s/rad)^0.333", r"$\mathrm{N\,m\,(s/rad)^{0.333}}$"),
    ],
)
def test_units(unit, latex):
    assert latex_unit(unit) == latex


def test_groups_are_written_with_their_coefficients():
    model = runnable_model(synthetic_identification())
    assert latex_group(model.base, 0) == r"$\mathit{zz}_{1} + \mathit{ia}_{1} + 0.16 \, m_{2}$"


HOSTILE = "a_b%c$d{e}f\\input{x}&#~^"


def hostile_model():
    model = runnable_model(random_robot(3))
    joints = list(model.robot.joints)
    joints[0] = replace(joints[0], name=HOSTILE)
    links = list(model.robot.links)
    links[0] = replace(links[0], name=HOSTILE)
    robot = replace(model.robot, name=HOSTILE, joints=tuple(joints), links=tuple(links))
    lines = f"{HOSTILE}\nnext"  # files may hold any method and note
    return replace(runnable_model(robot), notes=(lines,), origin=Origin(lines))


def test_names_are_escaped_and_stay_on_their_line():
    text = to_latex(hostile_model()).text
    assert r"\input" not in re.sub(r"^%.*", "", text, flags=re.MULTILINE)
    for line in text.splitlines():
        assert line.startswith("%") or not re.search(r"(?<!\\)%", line)
    assert "next" not in [line.strip() for line in text.splitlines()]
    for row in (*cells(text, 0), *cells(text, 1)):
        joined = " ".join(row)
        assert joined.count("{") - joined.count(r"\{") == joined.count("}") - joined.count(r"\}")
    assert one_line("a\nb\u202ec") == "a b c"


ENGINES = [name for name in ("pdflatex", "lualatex", "xelatex") if shutil.which(name)]


@pytest.mark.skipif(not ENGINES, reason="there is no LaTeX here")
def test_tables_compile(tmp_path):
    (tmp_path / "tables.tex").write_bytes(to_latex(hostile_model()).content)
    (tmp_path / "page.tex").write_text(
        r"\documentclass{article}\usepackage{amsmath,booktabs,longtable}"
        r"\begin{document}\input{tables}\end{document}"
    )
    command = [ENGINES[0], "-halt-on-error", "-interaction=nonstopmode", "page.tex"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=60)
    assert np.uint64((tmp_path / "page.pdf").stat().st_size) > 1000
