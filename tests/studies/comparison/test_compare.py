"""Results side by side: what differs is found, what does not is not, and all is said."""

import csv
import io
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import pivident as pv
from pivident.app.cli import main
from pivident.dynamics.regressor import Regressor
from pivident.foundation.errors import IdentificationFileError
from pivident.foundation.text.plain_values import json_of_entries
from pivident.robot.friction import FrictionLaw, coulomb, offset, viscous
from pivident.studies.comparison.account import (
    comparison_table,
    render_page,
    to_latex,
    to_values,
)
from pivident.studies.comparison.compare import compare
from pivident.studies.comparison.entry import ComparisonError
from pivident.studies.comparison.side_by_side import comparison_text
from tests.browser import needs_browser, seen_on_a_phone
from tests.studies.comparison.results import result, without
from tests.synthetic_identification import synthetic_identification

HOSTILE = "<script>alert(1)</script> & $x_1$ =cmd"


@pytest.fixture(scope="module")
def days():
    return [result(1), result(2), result(3, fv1=1.3)]


@pytest.fixture(scope="module")
def comparison(days):
    return compare(days, ["monday", "tuesday", "friday"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory, days):
    place = tmp_path_factory.mktemp("arm")
    for name, made in zip(("monday", "tuesday", "friday"), days, strict=True):
        made.save(place / name)
    return place


def test_the_parameter_that_changed_is_marked_and_no_other(comparison, days):
    assert comparison.marked(1) == () and comparison.marked(2) == ("fv1",)
    row = next(p for p in comparison.parameters if p.name == "fv1")
    change = days[2].value("fv1") - days[0].value("fv1")
    assert row.differences[2].value == pytest.approx(change)
    k = days[0].names.index("fv1")
    spread = 2 * math.hypot(days[0].robust_std[k], days[2].robust_std[k])
    assert row.differences[2].spread == pytest.approx(spread)
    assert comparison.tests == 2 * 13 and comparison.same_record == (False, False, False)


def test_files_say_what_memory_says(comparison, folder):
    names = ("monday", "tuesday", "friday")
    stored = compare([folder / name for name in names])
    assert stored.labels == names
    for a, b in zip(stored.parameters, comparison.parameters, strict=True):
        assert a.name == b.name
        for d, e in zip(a.differences[1:], b.differences[1:], strict=True):
            assert d.z == pytest.approx(e.z) and d.p_adjusted == pytest.approx(e.p_adjusted)
    # sums in the file against signals in memory
    for a, b in zip(stored.torques, comparison.torques, strict=True):
        np.testing.assert_allclose(a.error, b.error, rtol=1e-6)
    assert compare([folder]).labels == ("friday", "monday", "tuesday")
    assert stored.entries[0].source.sha256 and stored.entries[0].source.modified


def test_one_record_and_two_methods(days):
    ls = result(7, "IDIM-LS", record=1, fv1=1.02)
    found = compare([days[0], ls])
    assert found.labels == ("IDIM-PIV", "IDIM-LS") and found.same_record == (False, True)
    row = next(p for p in found.parameters if p.name == "fv1")
    k = ls.names.index("fv1")
    assert row.differences[1].spread == pytest.approx(
        2 * (ls.robust_std[k] + days[0].robust_std[k])
    )
    assert "correlation of their errors is not known" in " ".join(found.notes)


def test_unknown_records_are_taken_for_the_same(days):
    found = compare([days[0], replace(days[1], sources={})], ["a", "b"])
    assert found.same_record == (False, True)
    assert "not known from which record" in " ".join(found.notes)


def test_torques_are_those_of_the_signals(comparison, days):
    first, third = days[0], days[2]
    record, weights = first.recordings[0], np.array([1 / f.rms_error for f in first.joints])
    regressor = Regressor.build(first.robot, first.parameters)
    motion = (record.q, record.dq, record.ddq)
    votes = record.used
    apart = (regressor.torque(*motion, third.theta - first.theta) * weights)[votes]
    error = ((record.tau - regressor.torque(*motion, third.theta)) * weights)[votes]
    size = np.linalg.norm((record.tau * weights)[votes])
    assert comparison.torques[0].apart[2] == pytest.approx(np.linalg.norm(apart) / size)
    assert comparison.torques[0].error[2] == pytest.approx(np.linalg.norm(error) / size)
    assert comparison.torques[0].apart[0] == 0.0


def test_friction_curves_have_the_law_and_its_deviation(comparison, days):
    shoulder = comparison.friction[0]
    first = days[0]
    theta = {name: first.value(name) for name in ("fv1", "fc1", "off1")}
    joint = first.robot.joints[0]
    gamma = joint.friction.slopes[0]
    dq = shoulder.speed
    expected = theta["fv1"] * dq + theta["fc1"] * 2 / np.pi * np.arctan(gamma * dq) + theta["off1"]
    np.testing.assert_allclose(shoulder.curves[0].torque, expected, rtol=1e-12)
    std = dict(zip(first.names, first.robust_std, strict=True))
    at_rest = np.argmin(np.abs(dq))
    assert shoulder.curves[0].std[at_rest] == pytest.approx(std["off1"])
    assert shoulder.speed[-1] == pytest.approx(joint.rated_speed) and shoulder.rated


def test_parameters_that_were_left_out_are_named(days):
    found = compare([days[0], without(days[1], "my1", "my2")], ["all", "essential"])
    rows = {p.name: p for p in found.parameters}
    assert rows["my1"].estimates[1] is None and rows["my1"].differences[1] is None
    assert found.tests == 11
    assert "essential left out, as zero: my1, my2." in found.notes
    # the first result may be the one that lacks them
    turned = compare([without(days[1], "my1"), days[0]], ["essential", "all"])
    assert [p.name for p in turned.parameters if p.estimates[0] is None] == ["my1"]


def test_another_friction_law_shares_what_it_shares(days):
    law = FrictionLaw((viscous(), coulomb(), offset())[:2])
    robot = days[1].robot.with_friction(law)
    other = replace(without(days[1], "off1", "off2"), robot=robot)
    found = compare([days[0], other], ["with offset", "without"])
    assert {p.name for p in found.parameters if not p.shared} == {"off1", "off2"}
    notes = " ".join(found.notes)
    assert "friction laws differ" in notes and "without does not determine: off1, off2." in notes
    assert len(found.friction[0].curves) == 2
    # torques of the other law are not sums of the first one's parameters
    assert math.isnan(found.torques[0].error[1]) and np.isfinite(found.torques[1].error[1])


def test_different_robots_share_only_names(days):
    tx40 = synthetic_identification("IDIM-PIV", "staubli_tx40", seed=3)
    found = compare([days[0], tx40], ["planar", "tx40"])
    assert not found.one_machine and not found.torques and not found.friction
    names = [p.name for p in found.parameters]
    assert set(names) == set(days[0].names) & set(tx40.names)
    notes = " ".join(found.notes)
    assert "different: 2 and 6 joints" in notes
    assert "Not in all results, hence not compared, of tx40" in notes


def test_consistent_parameters_and_models(folder, tmp_path, capsys):
    place = tmp_path / "monday"
    pv.load_identification(folder / "monday").save(place)
    assert main(["consistent", str(place)]) == 0
    model = tmp_path / "model.json"
    assert main(["export", str(place), "--to", "json", "--out", str(model)]) == 0
    capsys.readouterr()
    found = compare([place, place / "consistent.json", model])
    assert [e.kind for e in found.entries] == ["identification", "consistent", "model"]
    consistent = found.entries[1]
    assert consistent.method == "PC-IDIM-PIV" and consistent.covariance is None
    assert (consistent.low <= consistent.value).all() and (
        consistent.value <= consistent.high
    ).all()
    row = next(p for p in found.parameters if p.name == "fv1")
    assert row.differences[1].p_value > 0.05 and math.isnan(row.differences[2].p_value)
    assert row.estimates[1].value == pytest.approx(row.estimates[2].value)
    assert any("no intervals" in note for note in found.notes)
    assert found.torques[0].error[1] < 1.2 * found.torques[0].error[0]
    assert "PC-IDIM-PIV" in comparison_text(found)
    render_page(found)


def test_names_are_the_shortest_that_differ(tmp_path, days):
    for day in ("a", "b"):
        days[0].save(tmp_path / day / "piv")
        replace(days[0], method="IDIM-LS").save(tmp_path / day / "ls")
    assert compare([tmp_path / "a"]).labels == ("IDIM-LS", "IDIM-PIV")
    assert compare([tmp_path / "a" / "piv", tmp_path / "b" / "piv"]).labels == ("a", "b")
    four = compare([tmp_path / "a", tmp_path / "b"])
    assert len(set(four.labels)) == 4 and "a/ls" in four.labels
    twins = compare([days[0], days[0]])
    assert len(set(twins.labels)) == 2


@pytest.mark.parametrize("count", [2, 3, 8])
def test_the_terminal_needs_80_columns(days, count):
    tx40 = [
        synthetic_identification("IDIM-PIV", "staubli_tx40", seed=k, sources={"a": str(k)})
        for k in range(2)
    ]
    for many in ([days[k % 3] for k in range(count)], tx40 if count == 2 else days):
        text = comparison_text(compare(many, [f"day {k}" for k in range(len(many))]))
        assert max(map(len, text.splitlines())) <= 80
        assert "day 0" in text and "Torque error on the record of" in text
        for name in many[0].names:
            assert re.search(rf"^{name} ", text, re.MULTILINE), name


def test_table_and_json_hold_every_number(comparison):
    rows = list(csv.DictReader(io.StringIO(comparison_table(comparison).to_csv())))
    assert len(rows) == 39
    marked = [(r["parameter"], r["result"]) for r in rows if r["significant"] == "True"]
    assert marked == [("fv1", "friday")]
    content = json.loads(json_of_entries(to_values(comparison)))
    assert content["tests"] == 26 and content["level"] == 0.05
    entry = next(p for p in content["parameters"] if p["name"] == "fv1")
    assert entry["differences"]["friday"]["significant"] is True
    assert entry["estimates"]["monday"]["value"] == comparison.entries[0].value[3]
    assert {f["joint"] for f in content["friction"]} == {"shoulder", "elbow"}


def test_latex_is_balanced_and_escaped(days):
    text = to_latex(compare(days[:2], [HOSTILE, "50 % & more"]))
    assert r"50 \% \& more" in text and r"\& \$x\_1\$ =cmd" in text
    body = text[text.index(r"\begin{tabular}") : text.index(r"\end{tabular}")]
    rows = [line for line in body.splitlines() if line.endswith(r"\\")]
    assert len({len(re.findall(r"(?<!\\)&", row)) for row in rows}) == 1
    assert len(re.findall(r"(?<!\\)\$", body)) % 2 == 0


class _Tags(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.seen = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.seen.append(tag)


def test_the_page_escapes_and_needs_nothing_else(days):
    page = render_page(compare(days, [HOSTILE, "tuesday", "friday"]))
    assert "<script>alert(1)" not in page
    assert _Tags(page).seen.count("section") == 6
    assert not re.search(r'(src|href)="https?:', page.split("<script>")[0])
    sheet = comparison_table(compare(days[:2], ["=1+1", "b"])).to_csv()
    assert "'=1+1" in sheet and not re.search(r"(^|,)=1", sheet, re.MULTILINE)


@needs_browser
def test_a_phone_shows_the_page(comparison, tmp_path):
    seen = seen_on_a_phone(render_page(comparison), tmp_path)
    assert seen["drawn"] == seen["plots"] == 2


def test_the_command(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["compare", str(folder), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "fv1" in said and "differs significantly" in said
    assert sorted(p.name for p in out.iterdir()) == [
        f"comparison.{kind}" for kind in ("csv", "html", "json", "tex")
    ]
    arms = [str(folder / name) for name in ("monday", "friday")]
    assert main(["compare", *arms, "--names", "new,worn", "--level", "0.01"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "worn: 1 of 13 parameters differs significantly from new: fv1 +" in said
    change, spread = map(float, re.search(r"new: fv1 \+([\d.]+) ± ([\d.]+) %\.", said).groups())
    assert 20.0 < change < 40.0 and 1.0 < spread < 10.0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (lambda f: [f / "monday"], "two or more"),
        (lambda f: [f / "nothing" / "identification.json", f], "check the path"),
        (lambda f: [f / "monday" / "parameters.csv", f], "not JSON"),
        (lambda f: [f / "monday", f / "friday", "--names", "a"], "1 names for 2 results"),
        (lambda f: [f / "monday", f / "friday", "--names", "a,a"], "given twice"),
        (lambda f: [f, "--level", "5"], "between 0 and 1"),
    ],
)
def test_what_cannot_be_compared_is_said_in_a_line(folder, capsys, arguments, says):
    assert main(["compare", *map(str, arguments(folder))]) == 1
    error = capsys.readouterr().err
    assert says in error and error.startswith("error: ") and error.count("\n") == 1


def test_wrong_arguments_in_python(days, tmp_path):
    with pytest.raises(ComparisonError, match="cannot be compared"):
        compare([days[0], 3])
    with pytest.raises(ComparisonError, match=r"holds no identification\.json"):
        compare([tmp_path, days[0]])
    with pytest.raises(ComparisonError, match="pivident fleet"):
        compare([days[0]] * 30)
    (tmp_path / "identification.json").write_text("{}")
    with pytest.raises(IdentificationFileError, match="not an identification"):
        compare([tmp_path, days[0]])
    with pytest.raises(ComparisonError):
        compare([])
