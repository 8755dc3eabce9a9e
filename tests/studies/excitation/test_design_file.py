import json
import math
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from pivident.foundation.errors import PividentError
from pivident.robot.robot_values import robot_values
from pivident.studies import DesignFileError, load_design
from pivident.studies.excitation.design import PredictedError
from pivident.studies.excitation.design_file import design_json
from tests.studies.excitation.designs import made_design, named


def same(a, b):
    """Whether two results hold the same numbers and words, bit for bit."""
    if is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a)
        )
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=True)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float) and math.isnan(a):
        return math.isnan(b)
    return a == b


def stored(design, folder):
    file = folder / "design.json"
    file.write_text(design_json(design), encoding="utf-8")
    return file


@pytest.mark.parametrize("robot", ["planar_2r", "staubli_tx40"])
@pytest.mark.parametrize("kind", ["fourier", "splines", "postures"])
def test_what_is_written_is_read_bit_for_bit(robot, kind, tmp_path):
    design = made_design(robot, kind)
    found = load_design(stored(design, tmp_path))
    assert robot_values(found.robot) == robot_values(design.robot)
    for name in (f.name for f in fields(design)):
        if name in ("robot", "obstacles"):
            continue
        assert same(getattr(design, name), getattr(found, name)), name
    for own, other in zip(found.obstacles, design.obstacles, strict=True):
        for name in ("name", "shape", "rotation", "translation", "size", "radius", "length"):
            np.testing.assert_array_equal(getattr(own, name), getattr(other, name))


def test_the_folder_names_its_design(tmp_path):
    stored(made_design(), tmp_path)
    assert load_design(tmp_path).criterion == "worst"


def test_the_file_is_strict_json_and_null_has_a_meaning_in_each_place(tmp_path):
    design = made_design()
    file = stored(design, tmp_path)

    def refuse(text):
        raise AssertionError(text)

    content = json.loads(file.read_text(encoding="utf-8"), parse_constant=refuse)
    assert content["cost"][0] is None
    found = load_design(file)
    assert found.cost[0] == math.inf
    assert found.predicted[2].std == math.inf and math.isnan(found.predicted[-1].value)
    assert next(u for u in found.limits if u.quantity == "torque" and u.high == math.inf)
    assert np.isnan(found.correlation[2]).all()


def test_what_is_optional_may_be_missing(tmp_path):
    design = replace(
        made_design(), torque=None, torque_margin=None, bodies=(), obstacles=(), clearances=()
    )
    found = load_design(stored(design, tmp_path))
    assert found.torque is None and found.bodies == () and found.obstacles == ()


def test_names_survive_whatever_they_hold(tmp_path):
    odd = named(made_design(), 'a"b\\c,<i>;', "\u00e9\U0001f600{}")
    found = load_design(stored(odd, tmp_path))
    assert found.robot.joint_names == odd.robot.joint_names


def damaged(**changes):
    """The content of a design with other values below dotted keys."""
    content = json.loads(design_json(made_design()))
    for key, value in changes.items():
        place = content
        *above, last = key.split("__")
        for part in above:
            place = place[int(part) if part.isdigit() else part]
        place[int(last) if last.isdigit() else last] = value
    return content


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"schema": 2}, "layout 2, this version reads 1; install a newer"),
        ({"schema": "1"}, "layout '1'"),
        ({"schema": True}, "layout True"),
        ({"format": "pivident-model"}, "is no design"),
        ({"extra": 1}, "extra = 1: extra inputs"),
        ({"motion__duration": None}, "motion.duration"),
        ({"motion__duration": -1.0}, "motion.duration = -1.0"),
        ({"motion__duration": 1e300}, "motion.duration"),
        ({"motion__kind": "magic"}, "motion.kind = 'magic'"),
        ({"motion__coefficients": [[1.0, 2.0]] * 2}, "1 + 2 harmonics"),
        ({"motion__coefficients": [[1.0]] * 9}, "(9, 1); 9 functions and 2 joints need shape"),
        ({"motion__coefficients__0__1": None}, "motion.coefficients.0.1"),
        ({"predicted__0__std": "small"}, "predicted.0.std = 'small'"),
        ({"predicted__0__wanted": 1}, "predicted.0.wanted = 1"),
        ({"limits__0__least": None}, "limits.0.least"),
        ({"limits__0__joint": "nobody"}, "joint 'nobody'"),
        ({"limits__1__high": 0.0}, "speed of 'shoulder' has the limits -"),
        ({"limits__0__low": 100.0}, "position of 'shoulder' has the limits 100 and"),
        ({"limits__0__quantity": "colour"}, "limits.0.quantity = 'colour'"),
        ({"correlation": [[1.0]]}, "has shape (1, 1); 13 parameters need shape (13, 13)"),
        ({"torque": [[1.0, 2.0]]}, "torque: 1 rows; 301 rows are needed"),
        ({"bodies__0__link": 7}, "is on link 7 of 2"),
        ({"bodies__0__radius": -0.1}, "bodies.0.radius = -0.1"),
        ({"obstacles__0__shape": "teapot"}, "obstacles.0.shape = 'teapot'"),
        ({"robot__joints__0__kind": "screw"}, "robot.joints.0.kind = 'screw'"),
        ({"robot__joints__0__rotation": [[2.0, 0.0, 0.0]] * 3}, "not orthonormal"),
    ],
)
def test_damage_is_named_with_its_place(changes, said, tmp_path):
    file = tmp_path / "design.json"
    file.write_text(json.dumps(damaged(**changes)))
    with pytest.raises(DesignFileError) as caught:
        load_design(file)
    assert str(caught.value).startswith(f"{file}: ") and said in str(caught.value)
    assert "pivident" in caught.value.advice


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_a_truncated_file_is_no_json(share, tmp_path):
    text = design_json(made_design())
    file = tmp_path / "design.json"
    file.write_text(text[: int(share * len(text))])
    with pytest.raises(DesignFileError, match="is not JSON"):
        load_design(file)


@pytest.mark.parametrize("text", ['{"cost": NaN}', '{"cost": Infinity}', "[1]", "[" * 100_000])
def test_other_files_are_refused(text, tmp_path):
    file = tmp_path / "design.json"
    file.write_text(text)
    with pytest.raises(DesignFileError):
        load_design(file)


def test_what_is_not_there_or_no_file_is_named(tmp_path):
    with pytest.raises(DesignFileError, match=r"design\.json: cannot be read \(No such file"):
        load_design(tmp_path)
    with pytest.raises(PividentError, match="not a file"):
        load_design("/dev/zero")


def test_moves_that_take_longer_than_the_motion_are_refused(tmp_path):
    design = made_design("planar_2r", "postures")
    content = json.loads(design_json(design)) | {"torque": None, "torque_margin": None}
    content["motion"]["duration"] = 0.2
    file = tmp_path / "design.json"
    file.write_text(json.dumps(content))
    with pytest.raises(DesignFileError, match="leave no time for 7 moves"):
        load_design(file)


def test_a_prediction_knows_its_relative_error():
    assert PredictedError("a", "", 2.0, 0.5, math.inf).relative == 0.25
