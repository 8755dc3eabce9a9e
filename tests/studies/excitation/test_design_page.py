import html
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from pivident.studies.collision.bodies import Obstacle
from pivident.studies.excitation.design_figures import (
    errors_figure,
    motion_figure,
    predicted_correlation,
)
from pivident.studies.excitation.design_file import write_design
from pivident.studies.excitation.design_view import (
    DesignFile,
    next_commands,
    picture_values,
    render_page,
)
from tests.browser import asked, needs_browser, seen_on_a_phone
from tests.studies.excitation.designs import made_design, named

HOSTILE = "<script>alert(1)</script>\"'&{{7*7}}"


class Reader(HTMLParser):
    """Headings, rows of tables, and elements by kind of a page."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.rows, self.tags, self.ids, self._cell = [], [], set(), None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.ids.add(dict(attributes).get("id"))
        if tag == "tr":
            self.rows.append([])
        if tag in ("th", "td") and self.rows:
            self.rows[-1].append("")
            self._cell = True

    def handle_endtag(self, tag):
        if tag in ("th", "td"):
            self._cell = None

    def handle_data(self, data):
        if self._cell and self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.strip()


@pytest.mark.parametrize(
    ("robot", "kind"), [("planar_2r", "fourier"), ("staubli_tx40", "postures"), ("emps", "splines")]
)
def test_the_page_has_every_part(robot, kind):
    design = made_design(robot, kind)
    page = Reader(render_page(design))
    assert page.ids >= {
        "summary", "replay", "signals", "limits", "errors", "correlations", "undetermined", "files",
    }  # fmt: skip
    cells = {cell for row in page.rows for cell in row}
    for p in design.predicted:
        assert p.name in cells
    for use in design.limits:
        assert [use.joint, use.quantity] in [row[:2] for row in page.rows]
    assert "22.3" in cells and "forearm and table <b>" in cells


def test_predicted_errors_stand_in_their_rows():
    design = made_design()
    rows = {row[0]: row for row in Reader(render_page(design)).rows if len(row) == 9}
    p = design.predicted[1]
    row = rows[p.name]
    assert float(row[1]) == pytest.approx(p.value, rel=0.02)
    assert float(row[2]) == pytest.approx(p.std, rel=0.06)
    assert float(row[5].split()[0]) == pytest.approx(100 * p.share, rel=0.06)
    assert row[3] == p.unit and row[7] == "10 ×"
    lost = rows[design.predicted[2].name]
    assert lost[2] == "∞" and lost[4] == "∞" and lost[8].startswith("its column vanishes")
    assert rows[design.predicted[-1].name][1] == "–"


def test_nothing_that_a_user_names_becomes_markup():
    design = named(made_design(), HOSTILE, "b" + HOSTILE)
    hostile = replace(
        design,
        robot=replace(design.robot, name=HOSTILE),
        notes=(HOSTILE,),
        settings={HOSTILE: HOSTILE, "robot": HOSTILE},
        cost_words=HOSTILE,
        noise=HOSTILE,
        criterion=HOSTILE,
        predicted=tuple(replace(p, name=f"{p.name}{HOSTILE}") for p in design.predicted),
        clearances=tuple(replace(c, name=HOSTILE) for c in design.clearances),
        bodies=tuple(replace(b, name=HOSTILE) for b in design.bodies),
        obstacles=tuple(replace(o, name=HOSTILE) for o in design.obstacles),
    )
    files = (DesignFile("design.json", HOSTILE, HOSTILE), DesignFile("motion.npz", HOSTILE, None))
    text = render_page(hostile, files)
    assert "<script>alert" not in text
    assert "{{7*7}}" in html.unescape(text)  # no template of its own
    plain = Reader(render_page(made_design(), (DesignFile("design.json", "x", "x"),)))
    assert Reader(text).tags.count("script") == plain.tags.count("script")


def test_the_picture_is_the_motion_with_its_room():
    design = made_design("staubli_tx40", "fourier")
    values = picture_values(design)
    (recording,) = values["recordings"]
    q = np.array(recording["q"]).T
    t = np.linspace(0.0, recording["duration"], len(q))
    np.testing.assert_allclose(q, design.motion.at(t)[0], atol=6e-5)
    assert len(values["bodies"]) == len(design.bodies)
    assert values["obstacles"][0]["size"] == [0.6, 0.9, 0.08]
    assert values["obstacles"][0]["translation"] == [0.6, 0.0, -0.3]
    json.dumps(values, allow_nan=False)


def test_an_obstacle_stands_in_its_pose():
    turned = np.diag([1.0, -1.0, -1.0])
    ball = Obstacle("ball", "sphere", turned, np.array([1.0, 2.0, 3.0]), radius=0.2)
    own = picture_values(replace(made_design(), obstacles=(ball,)))["obstacles"][0]
    assert own["translation"] == [1.0, 2.0, 3.0] and own["rotation"][4] == -1.0
    assert own["radius"] == 0.2 and own["length"] == 0.0


def lines(figure):
    """Levels of the limit lines of a figure by their axis."""
    found = {}
    for shape in figure.plot.layout.get("shapes", []):
        found.setdefault(shape["yref"], []).append(shape["y0"])
    return found


def test_signals_stand_between_their_limits():
    design = made_design()
    figure = motion_figure(design, 1)
    by_axis = lines(figure)
    limits = {u.quantity: u for u in design.limits if u.joint == "elbow"}
    assert by_axis["y"] == [limits["position"].low, limits["position"].high]
    assert by_axis["y2"] == [limits["speed"].low, limits["speed"].high]
    assert by_axis["y4"] == [limits["torque"].low]  # the upper one is infinite
    band, q, *_, tau = figure.plot.data
    expected = design.motion.at(np.asarray(q["x"], dtype=float))[0, :, 1]
    np.testing.assert_allclose(q["y"], expected, atol=1e-5)
    assert tau["yaxis"] == "y4" and band["yaxis"] == "y4"
    assert len(motion_figure(replace(design, torque=None), 0).plot.data) == 3


def test_errors_are_drawn_with_those_before_and_those_asked_for():
    design = made_design()
    before, after, wanted = errors_figure(design).plot.data
    assert list(wanted["x"]) == [p.name for p in design.predicted if p.wanted]
    shown = [p for p in design.predicted if np.isfinite(p.share)]
    assert len(after["x"]) + len(wanted["x"]) == len(shown)
    assert len(before["x"]) == sum(np.isfinite(p.before) for p in shown)
    unknown = tuple(replace(p, size=np.nan) for p in design.predicted)
    assert errors_figure(replace(design, predicted=unknown)) is None


def test_correlations_leave_out_what_is_not_determined():
    design = made_design()
    found = predicted_correlation(design)
    assert design.predicted[2].name not in found.names
    assert len(found.names) == len(design.predicted) - 1
    nothing = replace(design, correlation=np.full_like(design.correlation, np.nan))
    assert predicted_correlation(nothing) is None
    assert "correlations" not in Reader(render_page(nothing)).ids


def test_small_files_are_part_of_the_page_and_large_ones_beside_it(tmp_path):
    write_design(made_design("staubli_tx40", "postures"), tmp_path)
    text = (tmp_path / "design.html").read_text(encoding="utf-8")
    held = dict(re.findall(r'download="([^"]+)" data-file="([^"]+)"', text))
    assert {"postures.csv", "pivident_motion.src", "trajectory.yaml"} <= set(held)
    block = re.search(rf'id="{held["postures.csv"]}" [^>]*>(.*?)</script>', text, re.S).group(1)
    assert json.loads(block) == (tmp_path / "postures.csv").read_text(encoding="utf-8")
    assert 'href="motion.csv" download' in text and 'href="motion.npz" download' in text


def test_a_robot_in_a_command_is_one_word():
    design = replace(made_design(), settings={"robot": "my robot; rm -rf"})
    assert "--robot 'my robot; rm -rf' " in next_commands(design)[0]
    assert "--robot ROBOT " in next_commands(replace(design, settings={}))[0]


@pytest.mark.parametrize(("about", "command"), [("load", "payload"), ("gains", "gains")])
def test_two_runs_are_identified_together(about, command):
    design = replace(made_design(), settings={"about": about})
    assert next_commands(design)[-1] == f"pivident {command} experiment.toml"
    assert f"[[{command}.recording]]" in next_commands(design)[1]
    text = html.unescape(render_page(design))
    assert "once without and once with the load" in text
    assert "once without and once with the load" not in html.unescape(render_page(made_design()))


def test_a_design_that_breaks_a_limit_must_not_be_run():
    design = made_design()
    use = replace(design.limits[1], largest=1.2 * design.limits[1].high)
    text = html.unescape(render_page(replace(design, limits=(use,))))
    assert "Do not run this motion" in text
    assert "Do not run this motion" not in html.unescape(render_page(design))


@needs_browser
@pytest.mark.parametrize(
    ("robot", "kind"), [("planar_2r", "fourier"), ("staubli_tx40", "postures")]
)
def test_everything_is_drawn_on_a_phone(robot, kind, tmp_path):
    told = seen_on_a_phone(render_page(made_design(robot, kind)), tmp_path)
    assert told["plots"] == told["drawn"] == made_design(robot, kind).robot.size + 2


@needs_browser
def test_the_picture_moves_with_the_slider(tmp_path):
    script = """
      const canvas = document.querySelector(".replay canvas");
      const slider = document.querySelector(".replay input[type=range]");
      const rows = [...document.querySelectorAll(".posture tbody tr")];
      const positions = () => rows.map((row) => row.cells[1].textContent);
      const picture = () => canvas.toDataURL();
      await wait(300);
      const before = [positions(), picture()];
      slider.value = 2.5;
      slider.dispatchEvent(new Event("input"));
      await wait(300);
      return { moved: before[1] !== picture(), q: positions(), max: slider.max };
    """
    design = made_design()
    answer = asked(render_page(design), tmp_path, script)
    assert answer["moved"] and float(answer["max"]) == design.motion.duration
    q = design.motion.at(np.array([2.5]))[0, 0]
    shown = [float(text.removesuffix(" rad")) for text in answer["q"]]
    np.testing.assert_allclose(shown, q, atol=2e-2)
