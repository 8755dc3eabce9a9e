"""Results as a notebook shows them: small HTML that stands by itself.

No script, no font, no file from elsewhere. Colours come from the page: text is the notebook's own,
lines and shades are made from it, so that light and dark themes both show it. Tables have captions
and header cells, drawings a label in words. Everything that comes from outside is escaped.
"""

from functools import singledispatch
from typing import Any

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.problem import Problem
from pivident.estimation.summary import (
    ending,
    friction_line,
    rows_line,
    signals_line,
    std_line,
)
from pivident.foundation.document.document import Accounted, Document
from pivident.foundation.document.table import Table
from pivident.foundation.text.display import MAX_LINE, fields_in_words
from pivident.foundation.text.finding import MARKS
from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.numbers import format_significant
from pivident.judgement.diagnostics.verdict import Verdict
from pivident.judgement.report.builder import page_environment
from pivident.judgement.report.intervals import interval_drawing
from pivident.robot.description import Robot
from pivident.studies.comparison.compare import Comparison
from pivident.studies.comparison.remarks import findings, level_sentence
from pivident.studies.comparison.side_by_side import difference_text, estimate_text
from pivident.studies.tables.chosen import table

#: Rows of a table that are shown; a notebook keeps what it shows.
MAX_ROWS = 60

#: Points of a small curve.
POINTS = 160


@singledispatch
def html_of(result: Any) -> str:
    """A result as HTML, by its class: what it holds, where it has no display of its own."""
    return table_html(contents(result))


@singledispatch
def contents(result: Any) -> Table:
    """What a result holds, as a table: its fields with their values in a few words."""
    names, values = zip(*fields_in_words(result, MAX_LINE), strict=True)
    return Table(type(result).__name__, {"field": names, "value": values})


@contents.register
def robot_contents(robot: Robot) -> Table:
    """The joints of a robot."""
    return table(robot, "joints")


@contents.register
def recording_contents(recording: Recording) -> Table:
    """Range of the positions and size of the torques of each joint."""
    q, tau = recording.q, recording.tau
    columns: dict[str, Any] = {
        "joint": recording.joint_names,
        "lowest position": q.min(axis=0),
        "highest": q.max(axis=0),
        "unit": ["rad or m"] * recording.joints,
    }
    if recording.torque_source != "none":
        columns |= {
            "rms torque": np.sqrt(np.mean(tau**2, axis=0)),
            "largest": np.abs(tau).max(axis=0),
            "unit of torque": ["N m or N"] * recording.joints,
        }
    return Table("joints", columns)


@contents.register
def problem_contents(problem: Problem) -> Table:
    """The recordings of a problem."""
    columns = table(problem, "recordings").columns
    return Table("recordings", {name: own for name, own in columns.items() if name != "sha256"})


@html_of.register
def identification_html(result: Identification) -> str:
    """Parameters with intervals, fit of the joints, warnings."""
    rows = parameter_rows(result)
    return _rendered(
        "identification",
        result=result,
        ending=ending(result),
        std_line=f"Parameters ± 2σ. {std_line([result])}",
        rows_line=rows_line(result),
        signals_line=signals_line(result),
        friction_line=friction_line(result),
        rows=[
            (
                row,
                row.value_and_spread,
                interval_drawing([row], [result.method], with_zero=True),
            )
            for row in rows
        ],
    )


@html_of.register
def robot_html(robot: Robot) -> str:
    """Joints with their limits and friction laws."""
    return _rendered("robot", robot=robot, links=_masses(robot))


@html_of.register
def recording_html(recording: Recording, units: tuple[tuple[str, str], ...] = ()) -> str:
    """Rates, length, joints with their ranges, and a curve of each position.

    ``units`` are those of position and torque of each joint, where the robot is known.
    """
    rows, known = [], recording.torque_source != "none"
    for j, name in enumerate(recording.joint_names):
        q, tau = recording.q[:, j], recording.tau[:, j]
        rows.append(
            {
                "name": name,
                "low": format_significant(float(q.min())),
                "high": format_significant(float(q.max())),
                "rms": format_significant(float(np.sqrt(np.mean(tau**2)))) if known else "–",
                "peak": format_significant(float(np.abs(tau).max())) if known else "–",
                "units": units[j] if units else ("rad or m", "N m or N"),
                "curve": _curve(q),
            }
        )
    return _rendered("recording", recording=recording, rows=rows)


@html_of.register
def problem_html(problem: Problem) -> str:
    """What is given, in short."""
    return _rendered("problem", problem=problem, left_out=len(problem.base) - len(problem.names))


@html_of.register
def verdict_html(verdict: Verdict) -> str:
    """The statements with their severities."""
    return _rendered("verdict", verdict=verdict, marks=MARKS)


@html_of.register
def comparison_html(comparison: Comparison) -> str:
    """Parameters of all results side by side, significant differences marked."""
    return _rendered(
        "comparison",
        comparison=comparison,
        findings=findings(comparison),
        level_sentence=level_sentence(comparison),
        estimate_text=estimate_text,
        difference_text=difference_text,
    )


@html_of.register
def table_html(table: Table) -> str:
    """The first rows of a table."""
    return _rendered("table", sentences=(), tables=[table], findings=(), rows=MAX_ROWS)


@html_of.register
def document_html(document: Document) -> str:
    """Sentences, then tables, then findings."""
    findings = [str(finding) for finding in document.findings]
    blocks = [block for part in document.parts for block in part.blocks]
    sentences = [block for block in blocks if isinstance(block, str)]
    tables = [block for block in blocks if isinstance(block, Table)]
    return _rendered("table", sentences=sentences, tables=tables, findings=findings, rows=MAX_ROWS)


@html_of.register
def account_html(result: Accounted) -> str:
    """The account of any result that has one."""
    return document_html(result.account())


def _rendered(name: str, **content: Any) -> str:
    return escaped(
        page_environment("pivident.app.notebook").get_template(f"{name}.html").render(content)
    )


def _masses(robot: Robot) -> list[str]:
    """Nominal mass of each link of the tree, – where none is known."""
    return [
        format_significant(float(link.inertia[9])) if link.inertia[9] else "–"
        for link in robot.tree.links
    ]


def _curve(x: Any) -> str:
    """A signal as the points of a polyline, 100 wide and 20 high."""
    chosen = np.unique(np.linspace(0, x.size - 1, POINTS).astype(int))
    low, high = float(x.min()), float(x.max())
    u = 100.0 * np.linspace(0.0, 1.0, chosen.size)
    v = 19.0 - 18.0 * (x[chosen] - low) / ((high - low) or 1.0)
    return " ".join(f"{a:.4g},{b:.4g}" for a, b in zip(u, v, strict=True))
