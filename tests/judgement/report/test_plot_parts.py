"""Drawings are written as plotly itself would write them, and an attribute it lacks is an error."""

import json

import numpy as np
import plotly.graph_objects as go
import pytest

from pivident.foundation.document.plot import LEGEND, Figure, Plot
from pivident.judgement.report.builder import page_environment


def written(plot):
    """The figure as a page has it."""
    filters = page_environment().filters
    return json.loads(filters["script_json"](Figure(plot, 200, "title", "label")))


@pytest.mark.parametrize(
    "numbers",
    [
        np.array([1.5, np.nan, -2.0]),
        np.array([1.5, np.nan, -2.0], np.float32),
        np.arange(70_000, 70_003),
        np.arange(8.0)[::2],
        np.zeros(0),
        np.array(["a", "b"]),
        [0.5, None, 2.0],
    ],
)
def test_numbers_are_those_that_plotly_writes(numbers):
    plot = Plot()
    plot.add(y=numbers, error_y={"array": numbers})
    theirs = go.Figure(go.Scatter(y=numbers, error_y={"array": numbers})).to_plotly_json()["data"]
    assert written(plot)["data"] == json.loads(go.Figure(theirs).to_json())["data"]


def test_the_order_of_the_bytes_is_that_of_the_page():
    swapped, own = Plot(), Plot()
    swapped.add(y=np.array([1.5, -2.0], ">f8"))
    own.add(y=np.array([1.5, -2.0], "<f8"))
    assert written(swapped) == written(own)


def test_a_map_keeps_its_shape():
    z = np.arange(6.0).reshape(2, 3)
    plot = Plot()
    plot.add("heatmap", z=z)
    theirs = json.loads(go.Figure(go.Heatmap(z=z)).to_json())["data"]
    assert written(plot)["data"] == theirs


def test_layouts_are_merged_as_plotly_merges_them():
    plot = Plot(margin={"l": 58, "r": 12}, yaxis={"title": {"text": "", "standoff": 4}})
    theirs = go.Figure(layout=plot.layout)
    plot.update(margin={"r": 4}, legend=LEGEND)
    plot.update(legend={"y": -0.2})
    plot.y_axis("torque [N m]", type="log")
    plot.vertical(2.0, {"width": 1})
    theirs.update_layout(margin={"r": 4}, legend={**LEGEND, "y": -0.2})
    theirs.update_yaxes(title_text="torque [N m]", type="log")
    theirs.add_shape(type="line", yref="paper", x0=2.0, x1=2.0, y0=0, y1=1, line={"width": 1})
    theirs.layout.template = None
    assert written(plot)["layout"] == json.loads(theirs.to_json())["layout"]
    assert LEGEND["y"] == 1.02


def test_nothing_is_written_for_what_is_not_known():
    plot = Plot()
    plot.add("bar", y=[1.0], name=None)
    assert written(plot)["data"] == [{"type": "bar", "y": [1.0]}]


def test_tests_find_attributes_that_plotly_does_not_know():
    plot = Plot()
    plot.add(colour="red")
    with pytest.raises(ValueError, match="colour"):
        written(plot)
