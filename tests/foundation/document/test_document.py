"""One account of a result: what terminal, page, notebook and files show follows from it."""

import csv
import json
import re
from dataclasses import dataclass, field

import numpy as np
import pytest

from pivident.foundation.document.curves import Curve, Curves, compared, torque_axis
from pivident.foundation.document.document import Accounted, Document, Part
from pivident.foundation.document.plot import ERROR, MEASURED, METHOD_COLOURS, drawn
from pivident.foundation.document.table import Column, Table, TableError
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.plain_values import plain
from pivident.judgement.report.builder import page_of_documents, write_account
from pivident.studies.tables.chosen import table, table_names

HOSTILE = "<script>alert(1)</script> & =1+1"


def made_table():
    columns = {
        "joint": Column(("a", HOSTILE)),
        "value": Column(
            np.array([1.23456, 7.0]), spread=np.array([0.05, np.nan]), spread_title="±", digits=3
        ),
        "std": Column(np.array([0.025, np.inf]), shown="files"),
        "start": Column(np.array([1.0, 2.0]), "first value", shown="pages", digits=2),
        "kind": Column((None, True), "σ known"),
    }
    return Table("values", columns, title="What was found")


@dataclass(frozen=True, eq=False)
class Found(Accounted):
    """A result with an account of everything that there is."""

    name: str = "arm"
    drawn: np.ndarray = field(default_factory=lambda: np.zeros(3), repr=False)

    def account(self) -> Document:
        t = np.arange(100) / 50.0 + 7.0
        curves = Curves(
            HOSTILE, torque_axis("N m"), t, compared(np.sin(t), np.cos(t), "model", 1), "Torque"
        )
        parts = (
            Part(f"Values of {self.name}", ("Headline with `a command`.", made_table())),
            Part("Curves", ("What is drawn.",), [curves]),
        )
        findings = (Finding("warning", "noise", "loud", "It is loud."), f"See {HOSTILE}.")
        return Document(f"{self.name} {HOSTILE}", parts, findings, {"found": self}, made_table())


def test_columns_are_shown_where_they_belong():
    made = made_table()
    assert [title for title, *_ in made.shown()] == ["joint", "value", "±", "σ known"]
    page = {title: (align, cells) for title, align, cells in made.shown(page=True)}
    assert list(page) == ["joint", "value", "±", "first value", "σ known"]
    assert page["value"] == (".", ["1.235", "7.00"]) and page["±"] == (".", ["0.050", "–"])
    assert page["first value"] == (".", ["1.0", "2.0"]) and page["σ known"] == ("<", ["–", "yes"])
    assert made["std"][1] == np.inf and made.to_polars().columns == list(made.columns)
    assert made.shown(1)[0] == ("joint", "<", ["a"])


def test_files_have_all_columns_and_no_formula():
    rows = list(csv.DictReader(made_table().to_csv().splitlines()))
    assert rows[0] == {
        "joint": "a", "value": "1.23456", "std": "0.025", "start": "1.0", "kind": "",
    }  # fmt: skip
    assert rows[1]["joint"] == HOSTILE and rows[1]["std"] == ""
    own = Table("own", {"x": Column(np.array([1 / 3, np.nan]), file_format="%.4g"), "=y": (1, 2)})
    assert own.to_csv() == "x,=y\n0.3333,1\n,2\n"
    with pytest.raises(TableError, match="same length"):
        Table("a", {"x": Column((1, 2)), "y": (1,)})


def test_long_names_are_cut_where_rows_are_and_nowhere_else():
    made = Table("names", {"name": ("x" * 60,) * 30})
    assert "x" * 60 in made.text() and len(made.text().splitlines()) == 31
    assert "x" * 60 not in str(made) and "… and 10 more rows" in str(made)


def test_the_text_has_tables_under_their_titles_and_findings_at_the_end():
    text = str(Found())
    assert text == "\n\n".join(
        [
            "Headline with `a command`.",
            made_table().text(),
            "What is drawn.",
            "! noise: It is loud.",
            f"See {HOSTILE}.",
        ]
    )
    assert Found().account().body == text.partition("\n\n! noise")[0]


def test_everything_on_a_page_is_escaped(tmp_path):
    page = write_account(Found(), tmp_path / "page.html").read_text("utf-8")
    assert HOSTILE not in page and page.count("&lt;script&gt;alert(1)") >= 4
    assert ">First value</th>" in page and ">σ known</th>" in page
    assert "<code>a command</code>" in page and 'id="values_of_arm"' in page
    assert page.index("It is loud.") < page.index('id="curves"')
    assert re.search(r'class="key measured"></span> measured', page)


def test_several_results_of_one_kind_are_one_page(tmp_path):
    both = [Found(), Found("leg")]
    page = write_account(both, tmp_path / "p.html", ["one", "two"]).read_text("utf-8")
    assert 'id="curves-1"' in page and 'id="curves-2"' in page
    assert "two: Values of leg" in page
    assert page == page_of_documents([one.account() for one in both], ["one", "two"])


def test_curves_are_drawn_in_the_colours_of_their_roles():
    t = np.linspace(5.0, 7.0, 50)
    lines = (*compared(t, 2.0 * t, "model", 1), Curve("other", t, 0))
    figure = drawn(Curves("elbow", "torque [N m]", t, lines, "Torque", "rms 1"))
    colours = [trace["line"]["color"] for trace in figure.plot.data]
    assert colours == [MEASURED, METHOD_COLOURS[1], ERROR, METHOD_COLOURS[0]]
    assert figure.start == 5.0 and figure.plot.data[0]["x"][0] == 0.0
    np.testing.assert_allclose(figure.plot.data[2]["y"], -t, rtol=1e-6)
    assert figure.label == "Torque over 2.00 s: rms 1"


def test_a_folder_holds_values_table_text_and_what_else_belongs_there(tmp_path):
    document = Found().account()
    document.save(tmp_path, "found", "<p>", {"robot.xml": b"<mujoco/>"})
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["found.csv", "found.html", "found.json", "found.txt", "robot.xml"]
    assert json.loads((tmp_path / "found.json").read_text("utf-8")) == {"found": {"name": "arm"}}
    assert (tmp_path / "found.csv").read_text("utf-8") == made_table().to_csv()
    assert (tmp_path / "found.txt").read_text("utf-8") == f"{document}\n"
    Document("t", (), values={"a": 1}).save(tmp_path / "less", "own")
    assert sorted(path.name for path in (tmp_path / "less").iterdir()) == ["own.json", "own.txt"]


def test_what_a_class_does_not_print_is_not_stored():
    assert plain(Found()) == {"name": "arm"}


def test_accounts_have_frames_and_are_shown_in_notebooks():
    assert table_names(Found()) == ("values",)
    assert table(Found())["joint"] == ("a", HOSTILE)
    with pytest.raises(TableError, match="no table 'joints'"):
        table(Found(), "joints")
    shown = Found()._repr_html_()
    assert HOSTILE not in shown and "Headline" in shown and "It is loud" in shown
    assert "What was found, 2 rows" in shown and "first value" in shown
