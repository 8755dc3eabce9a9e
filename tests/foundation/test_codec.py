"""Dataclasses as JSON and back, and the files of results that this and earlier versions wrote."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest

from pivident.estimation.identification_file import to_json
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.codec import Layout, decode
from pivident.foundation.errors import IdentificationFileError, UnusableValue
from pivident.foundation.text.plain_values import (
    INFINITE_IN_WORDS,
    LATER,
    NOT_STORED,
    SPARSE,
    As,
    Called,
    Known,
    Limits,
    Null,
    Sized,
    json_of_entries,
    plain,
)
from pivident.models import model_json
from pivident.models.stored_model import stored_model
from pivident.robot.gallery import load_robot
from pivident.studies.excitation.design_file import design_json, load_design

STORED = Path(__file__).parents[1] / "stored"


@dataclass(frozen=True)
class Point:
    x: float
    y: Known = math.nan


@dataclass(frozen=True, eq=False)
class Everything:
    name: Annotated[str, Limits(min_length=1)]
    kind: Literal["a", "b"]
    count: Annotated[int, Limits(ge=0)]
    point: Point | None
    points: tuple[Point, ...]
    pair: tuple[str, float]
    numbers: dict[str, float]
    span: Annotated[tuple[float, float], Null(math.inf)]
    limit: Annotated[float, INFINITE_IN_WORDS]
    matrix: Annotated[np.ndarray, Sized("rows", "columns"), Null(math.nan)]
    used: Annotated[np.ndarray, Sized("rows", of=bool)]
    doubled: Annotated[float, As(float, lambda x: 2.0 * x, lambda x: x / 2.0)]
    column: Annotated[str, Called("function")]
    anything: Any
    sign: Annotated[int, LATER] = 1
    place: Annotated[tuple[int | str, ...], SPARSE] = ()
    digits: Annotated[int, NOT_STORED] = 4


WHOLE = Everything(
    name="n",
    kind="a",
    count=3,
    point=Point(1.0),
    points=(Point(1.0, 2.0), Point(-0.0)),
    pair=("q", 0.1),
    numbers={"a": 1e-300},
    span=(0.5, math.inf),
    limit=-math.inf,
    matrix=np.array([[1.0, np.nan], [0.1, 3.0], [5.0, 6.0]]),
    used=np.array([True, False, True]),
    doubled=1.5,
    column="c",
    anything={"a": [1, None]},
)


def test_marks_say_how_fields_are_written():
    content = plain(WHOLE)
    assert content["point"] == {"x": 1.0, "y": None}
    assert content["span"] == [0.5, None] and content["limit"] == "-inf"
    assert content["matrix"][0] == [1.0, None] and content["used"] == [True, False, True]
    assert content["doubled"] == 3.0 and content["function"] == "c"
    assert not {"column", "place", "digits"} & content.keys()


def test_what_is_written_is_read():
    content = json.loads(json.dumps(plain(WHOLE), allow_nan=False))
    found = decode(Everything, content)
    assert plain(found) == content
    assert found.span == (0.5, math.inf) and found.limit == -math.inf
    assert math.isnan(found.point.y) and isinstance(found.points, tuple)
    np.testing.assert_array_equal(found.matrix, WHOLE.matrix)
    assert found.used.dtype == bool and found.sign == 1 and found.digits == 4


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"name": ""}, "name = '': string should have at least 1 character"),
        ({"kind": "c"}, "kind = 'c': must be 'a' or 'b'"),
        ({"count": 1.0}, "count = 1.0: must be a valid integer"),
        ({"count": -1}, "count = -1: must be greater than or equal to 0"),
        ({"count": True}, "count = True"),
        ({"point": []}, r"point = \[\]: must be a valid dictionary"),
        ({"points": [{"x": "1"}]}, r"points\.0\.x = '1': must be a valid number \(and 1 more\)"),
        ({"points": {}}, "points = {}: must be a valid list"),
        ({"pair": ["q"]}, "pair = .*at least 2 items"),
        ({"pair": ["q", "q"]}, r"pair\.1 = 'q'"),
        ({"numbers": {"a": None}}, r"numbers\.a = None"),
        ({"numbers": {"a": math.inf}}, r"numbers\.a = inf: must be a finite number"),
        ({"limit": "nan"}, "limit = 'nan'"),
        ({"limit": math.nan}, "limit = nan: must be a number or infinite, not NaN"),
        ({"matrix": [[1.0], [1.0, 2.0]]}, "matrix = .*2 rows of 1 or 2 numbers"),
        ({"used": [True]}, r"used = \[True\]: has shape \(1,\); 3 rows need shape \(3,\)"),
        ({"used": [1, 0, 1]}, r"used\.0 = 1: must be a valid boolean"),
        ({"place": [1.5]}, r"place\.0"),
        ({"other": 1}, "other = 1: extra inputs are not permitted"),
        ({"digits": 1}, "digits = 1: extra inputs"),
        ({"function": KeyError}, "function: field required"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(changes, said):
    content = {k: x for k, x in (plain(WHOLE) | changes).items() if x is not KeyError}
    with pytest.raises(UnusableValue, match=f"^{said}"):
        decode(Everything, content)


@pytest.mark.parametrize("key", ["points", "used", "matrix"])
def test_the_first_wrong_entry_of_a_list_is_enough(key):
    """Millions of errors, each with its place, would not fit into the memory."""
    with pytest.raises(UnusableValue, match=rf"^{key}\.0") as caught:
        decode(Everything, plain(WHOLE) | {key: [None] * 1000})
    assert "more)" not in str(caught.value)


def test_what_no_file_can_hold_is_no_annotation():
    with pytest.raises(TypeError, match="nothing that a file can hold"):
        decode(complex, 1.0)


def test_sizes_that_are_known_are_those_of_the_arrays():
    assert decode(Everything, plain(WHOLE), rows=3, columns=2).matrix.shape == (3, 2)
    with pytest.raises(UnusableValue, match=r"4 rows and 2 columns need shape \(4, 2\)"):
        decode(Everything, plain(WHOLE), rows=4)


NUMBERED = Layout(
    "list",
    3,
    give="give a list",
    again="write it again",
    older={1: lambda c: {"x": c["number"]}, 2: lambda c: c | {"y": 2.0 * c["x"]}},
)


@pytest.mark.parametrize(
    ("content", "point"),
    [
        ({"schema": 1, "number": 1.0}, Point(1.0, 2.0)),
        ({"schema": 2, "x": 3.0}, Point(3.0, 6.0)),
        ({"schema": 3, "x": 3.0, "y": 4.0}, Point(3.0, 4.0)),
    ],
)
def test_older_layouts_are_raised_to_the_newest(content, point):
    assert decode(Point, NUMBERED.raised(content, "file")) == point


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"schema": 4}, "file: has layout 4, this version reads up to 3; install a newer"),
        ({"schema": 0}, "has layout 0, this version reads up to 3; write it again"),
        ({"schema": True}, "has layout True"),
        ({}, "has layout None"),
        ({"format": "x", "schema": 3}, "is no list: its format is 'x', not ''; give a list"),
        ({"schema": 1}, "is no list of layout 1; the file is damaged"),
        ({"schema": 2, "x": None}, "is no list of layout 2"),
    ],
)
def test_other_layouts_are_refused(content, said):
    with pytest.raises(IdentificationFileError, match=said):
        NUMBERED.raised(content, "file")


def read(file):
    """A stored result, by the name of its file."""
    if file.name.startswith("identification"):
        robot = load_robot("planar_2r") if file.name.endswith("-1.json") else None
        return load_identification(file, robot=robot)
    if file.name.startswith("model"):
        return model_json.read_model(file)
    return load_design(file) if file.name == "design.json" else stored_model(file)[0]


FILES = sorted(STORED.glob("*.json"))
assert FILES, STORED


def test_options_that_were_renamed_are_read(tmp_path):
    """`horizon` of fitted simulations was called segment."""
    content = json.loads((STORED / "identification-simulated.json").read_text("utf-8"))
    del content["simulation"]["horizon"]
    for value in (None, 1.5):
        content["options"]["segment"] = value
        content["options"]["loop"] = "open" if value else "closed"
        content["kind"] = "oloe" if value else "cloe"
        content["options"]["free"] = [] if value else content["options"]["free"]
        old = tmp_path / "old.json"
        old.write_text(json.dumps(content), "utf-8")
        method = load_identification(old).method_used
        assert method is not None and method.horizon == value


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_stored_files_are_read_and_written_byte_for_byte(file):
    found, text = read(file), file.read_text(encoding="utf-8")
    if file.name.startswith("identification-layout-") and not file.name.endswith("4.json"):
        newest = read(STORED / "identification-layout-4.json")
        np.testing.assert_array_equal(found.theta, newest.theta)
        np.testing.assert_array_equal(found.robust_std, newest.robust_std)
        assert found.joints == newest.joints and found.names == newest.names
    elif file.name.startswith("identification"):
        assert to_json(found) == text
    elif file.name.startswith("model"):
        assert model_json.to_json(found).content.decode() == text
    elif file.name == "design.json":
        version = {"version": json.loads(text)["version"]}
        assert json_of_entries(json.loads(design_json(found)) | version) == text
    else:
        standard = {p["name"]: p["value"] for p in json.loads(text)["standard"]}
        own = zip((p.name for p in found.parameters), found.values.tolist(), strict=True)
        assert standard == dict(own)
