import copy
import json
import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import pivident as pv
from pivident.dynamics.grouping import closed_form
from pivident.estimation import stored_identification as reload
from pivident.estimation.identification_file import (
    IDENTIFICATION,
    save_identification,
    to_dict,
    to_json,
)
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.errors import IdentificationError, IdentificationFileError
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.plain_values import plain
from pivident.judgement.validation.moment_sums import kept_equations
from pivident.judgement.validation.residuals.residual_tests import residual_tests
from pivident.robot.friction import FrictionLaw, coulomb, load_dependent, lugre, viscous
from pivident.robot.gallery import load_robot
from tests.synthetic_identification import synthetic_identification, synthetic_loop


def saved(tmp_path, identification):
    save_identification(identification, tmp_path)
    return load_identification(tmp_path / "identification.json")


@pytest.mark.parametrize("robot", ["planar_2r", "staubli_tx40", "emps"])
def test_everything_but_the_signals_comes_back(tmp_path, robot):
    identification = synthetic_identification(robot_name=robot)
    loaded = saved(tmp_path, identification)
    assert to_json(loaded) == to_json(identification)
    assert loaded.parameters == identification.parameters
    assert loaded.joints == identification.joints
    for name in ("theta", "covariance", "robust_covariance", "formula_covariance"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(identification, name))
    assert loaded.recordings == () and loaded.equations is None
    q = np.random.default_rng(0).normal(size=(3, 20, identification.robot.size))
    np.testing.assert_array_equal(loaded.predict(*q), identification.predict(*q))
    assert loaded.summary().splitlines()[:8] == identification.summary().splitlines()[:8]


def test_front_door_takes_the_folder(tmp_path):
    identification = synthetic_identification()
    identification.save(tmp_path)
    assert pv.load_identification(tmp_path).value("zz1") == identification.value("zz1")


@pytest.mark.parametrize(
    "law", [(viscous(), *lugre(1e-3, 0.3, 0.1)), (viscous(), coulomb(), load_dependent())]
)
def test_friction_with_memory_and_load_predicts_the_same(tmp_path, law):
    robot = load_robot("planar_2r").with_friction(FrictionLaw(law))
    base = pv.base_parameters(robot)
    plain = synthetic_identification()
    size = len(base)
    theta = np.linspace(0.1, 0.9, size)
    identification = replace(
        plain,
        robot=robot,
        parameters=base.parameters,
        names=base.names,
        expressions=base.expressions,
        judged=None,
        theta=theta,
        covariance=np.eye(size),
        robust_covariance=np.eye(size),
        formula_covariance=np.eye(size),
        history=(),
    )
    loaded = saved(tmp_path, identification)
    q = np.random.default_rng(0).normal(size=(3, 50, 2))
    np.testing.assert_array_equal(loaded.predict(*q), identification.predict(*q))


def test_warnings_with_intervals_come_back(tmp_path):
    evidence = {"ia2": Quantity(-0.04, "kg m²", bound=0.0, interval=(-0.06, -0.02))}
    finding = Finding("warning", "physics", "negative", "ia2 is negative.", evidence=evidence)
    identification = replace(synthetic_identification(), warnings=(finding,))
    loaded = saved(tmp_path, identification)
    assert loaded.warnings == identification.warnings


@pytest.mark.parametrize("wrong", [[0.1], [0.1, 0.2, 0.3], ["a", "b"], 0.1])
def test_an_interval_has_two_ends(tmp_path, wrong):
    evidence = {"ia2": Quantity(-0.04, "kg m²", interval=(-0.06, -0.02))}
    finding = Finding("warning", "physics", "negative", "ia2 is negative.", evidence=evidence)
    content = to_dict(replace(synthetic_identification(), warnings=(finding,)))
    content["warnings"][0]["evidence"]["ia2"]["interval"] = wrong
    (tmp_path / "identification.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(IdentificationFileError, match="interval"):
        load_identification(tmp_path)


def test_essential_parameters_come_back(tmp_path):
    full = synthetic_identification()
    keep = np.array([0, 2, 3])
    part = replace(
        full,
        parameters=tuple(full.parameters[k] for k in keep),
        names=tuple(full.names[k] for k in keep),
        expressions=tuple(full.expressions[k] for k in keep),
        judged=None,
        theta=full.theta[keep],
        covariance=full.covariance[np.ix_(keep, keep)],
        robust_covariance=full.covariance[np.ix_(keep, keep)],
        formula_covariance=full.covariance[np.ix_(keep, keep)],
        history=(),
    )
    loaded = saved(tmp_path, part)
    assert loaded.names == part.names
    assert loaded.torque_sums.moment.size == len(full.names)


def test_numbers_that_were_not_finite_come_back(tmp_path):
    plain = synthetic_identification()
    unknown = np.full_like(plain.covariance, np.nan)
    loose = replace(
        plain,
        condition=np.inf,
        robust_covariance=unknown,
        joints=tuple(replace(j, f50=np.nan) for j in plain.joints),
    )
    loaded = saved(tmp_path, loose)
    assert loaded.condition == np.inf
    assert np.isnan(loaded.robust_covariance).all()
    assert np.isnan(loaded.joints[0].f50)


@pytest.mark.parametrize("found", ["law", "moves", "spline"])
def test_what_is_known_of_the_loop_is_kept(tmp_path, found):
    identification = synthetic_identification(loop=synthetic_loop(found))
    loaded = saved(tmp_path, identification)
    assert loaded.loop is None
    assert to_dict(loaded)["controller"] == json.loads(to_json(identification))["controller"]
    assert to_dict(loaded)["reference"] == json.loads(to_json(identification))["reference"]


def test_tests_of_the_signals_say_that_they_are_not_there(tmp_path):
    loaded = saved(tmp_path, synthetic_identification())
    with pytest.raises(IdentificationError, match="equations of this IDIM-PIV result were not"):
        kept_equations(loaded)
    assert residual_tests(loaded).joints == ()


def test_report_of_a_loaded_result_has_its_tables(tmp_path):
    loaded = saved(tmp_path, synthetic_identification())
    pv.write_report([loaded], tmp_path / "report.html")
    assert "zz1r" in (tmp_path / "report.html").read_text("utf-8")


def test_a_file_of_the_third_layout_shows_the_robust_standard_errors(tmp_path):
    """There ``std`` was by the method's covariance, and ``robust_std`` stood beside it."""
    found = synthetic_identification()
    content = to_dict(found) | {"schema": 3}
    for row, robust in zip(content["parameters"], found.robust_std.tolist(), strict=True):
        del row["low"], row["high"]
        row["std"], row["robust_std"] = row.pop("method_std"), robust
    (tmp_path / "identification.json").write_text(json.dumps(content), encoding="utf-8")
    loaded = load_identification(tmp_path)
    np.testing.assert_array_equal(loaded.std, found.robust_std)
    np.testing.assert_array_equal(loaded.method_std, found.method_std)
    assert not np.array_equal(loaded.std, loaded.method_std)


def test_file_of_the_first_layout_needs_its_robot(tmp_path):
    identification = synthetic_identification()
    old = to_dict(identification) | {"schema": 1}
    del old["robot_description"], old["torque_sums"]
    path = tmp_path / "identification.json"
    path.write_text(json.dumps(old))
    with pytest.raises(IdentificationFileError, match=r"layout 1, .*identify again, or give the"):
        load_identification(path)
    loaded = load_identification(path, robot=identification.robot)
    np.testing.assert_array_equal(loaded.theta, identification.theta)
    assert loaded.torque_sums is None
    with pytest.raises(IdentificationFileError, match=r"joints: has shape \(2,\); 1 joints need"):
        load_identification(path, robot=load_robot("emps"))


def written(tmp_path, path, value):
    content = copy.deepcopy(to_dict(synthetic_identification()))
    *above, last = path
    place = content
    for part in above:
        place = place[part]
    if value is KeyError:
        del place[last]
    else:
        place[last] = value
    file = tmp_path / "identification.json"
    file.write_text(json.dumps(content))
    return file


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["schema"], 5, "layout 5, this version reads up to 4; install a newer"),
        (["schema"], "2", "is not an identification"),
        (["covariance"], KeyError, "is not an identification"),
        (["robot_description"], KeyError, "'robot_description' is missing"),
        (["theta"], [], "theta = .*: extra inputs"),
        (["readings"], [{"columns": {}}], r"readings.0.units: field required"),
        (["readings"], [{"file": "/etc"}], r"readings.0.columns: field required"),
        (["motion"], {"low": [0.0, 0.0]}, "motion.high: field required"),
        (["method"], KeyError, "method: field required"),
        (["parameters"], [], "at least 1"),
        (["parameters", 0, "value"], None, r"parameters\.0\.value = None: must be a valid number"),
        (["parameters", 0, "value"], "1", r"parameters\.0\.value = '1'"),
        (["parameters", 0, "name"], "zz9", "'zz9' is not a base parameter of the robot"),
        (["parameters", 0, "name"], "mx2", "not in the robot's order"),
        (["covariance", 0, 0], -1.0, "variance -1 in row 1"),
        (["covariance", 0, 1], 1.0, "covariance is not symmetric"),
        (["covariance", 0], [1.0], "13 rows of 1 or 13 numbers"),
        (["covariance"], [], "need shape"),
        (["history", 0, "theta"], [1.0], r"theta = \[1.0\]: has shape \(1,\); 13 parameters need"),
        (["joints"], [], r"joints = \[\]: has shape \(0,\); 2 joints need"),
        (["joints", 0, "name"], "other", "joints are other, "),
        (["joints", 0, "rows"], -1, r"joints\.0\.rows = -1"),
        (["robot_description", "gravity"], [0.0], r"robot_description\.gravity"),
        (["robot_description", "joints", 1, "parent"], 5, "parent 5 does not precede it"),
        (["torque_sums", "gram"], [1.0], "torque_sums.moment: has shape"),
        (["torque_sums", "square"], KeyError, "torque_sums.square: field required"),
        (["options", "signals"], 3, r"options\.signals must be a dictionary"),
        (["torque_sums", "square"], 10**400, "torque_sums.square: must be a valid number"),
        (["options"], [], r"options = \[\]: must be a valid dictionary"),
    ],
)
def test_damaged_files_are_named_with_their_key(tmp_path, path, value, message):
    file = written(tmp_path, path, value)
    with pytest.raises(IdentificationFileError, match=message) as caught:
        load_identification(file)
    assert caught.value.file == str(file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["covariance"], []),
        (["joints"], []),
        (["parameters", 0, "name"], "zz9"),
        (["history", 0, "theta"], [1.0]),
    ],
)
def test_what_does_not_fit_is_refused_before_base_parameters_are_searched(
    tmp_path, monkeypatch, path, value
):
    def searched(robot):
        raise AssertionError("the search takes seconds on a robot of many joints")

    file = written(tmp_path, path, value)
    monkeypatch.setattr(reload, "base_parameters", searched)
    with pytest.raises(IdentificationFileError):
        load_identification(file)


def test_groups_that_the_closed_form_lacks_are_searched_for(tmp_path, monkeypatch):
    """As geometry at the edge of a tolerance would have it."""
    identification = synthetic_identification()

    def with_other_groups(robot):
        base = pv.base_parameters(robot)
        return replace(base, kept=base.kept[1:], regrouping=base.regrouping[1:])

    monkeypatch.setattr(closed_form, "quick_base_parameters", with_other_groups)
    loaded = saved(tmp_path, identification)
    assert to_json(loaded) == to_json(identification)


def test_indefinite_covariance_is_refused(tmp_path):
    content = to_dict(synthetic_identification())
    wrong = np.array(content["covariance"])
    wrong[0, 1] = wrong[1, 0] = 2.0 * np.sqrt(wrong[0, 0] * wrong[1, 1])
    file = tmp_path / "identification.json"
    file.write_text(json.dumps(content | {"covariance": wrong.tolist()}), encoding="utf-8")
    with pytest.raises(IdentificationFileError, match="correlations have the eigenvalue -1"):
        load_identification(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not JSON"),
        (b"\xff\xfe", "is not JSON"),
        (b"[" * 100_000, "is not JSON"),
        (b'{"schema": 2, "covariance": [NaN]}', "is not JSON"),
        (b'{"schema": 2, "covariance": [1e999]}', "is not JSON|identification"),
        (b"[1]", "holds a list"),
        (b"{}", "is not an identification"),
        (b'{"schema": 2, "covariance": []}', "robot_description"),
    ],
)
def test_what_is_no_identification_is_refused(tmp_path, content, message):
    file = tmp_path / "identification.json"
    file.write_bytes(content)
    with pytest.raises(IdentificationFileError, match=message):
        load_identification(file)


def test_missing_file_names_the_methods_there_are(tmp_path):
    for name in ("piv", "ls"):
        save_identification(synthetic_identification(), tmp_path / name)
    with pytest.raises(IdentificationFileError, match="one for each method: 'ls', 'piv'"):
        load_identification(tmp_path)
    with pytest.raises(IdentificationFileError, match="No such file"):
        load_identification(tmp_path / "nothing" / "identification.json")


def test_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(reload, "IDENTIFICATION", replace(IDENTIFICATION, max_bytes=10))
    save_identification(synthetic_identification(), tmp_path)
    with pytest.raises(IdentificationFileError, match="more than any file of its kind"):
        load_identification(tmp_path)


def places(content, path=()):
    """Paths of all entries of nested lists and dictionaries, the first four of each list."""
    entries = content.items() if isinstance(content, dict) else ()
    entries = enumerate(content[:4]) if isinstance(content, list) else entries
    for key, entry in entries:
        yield (*path, key)
        yield from places(entry, (*path, key))


STRANGE = (None, True, -1, 10**30, 1e308, 5e-324, "", "nan", [], {}, [None], {"a": 1})


@cache
def content_of_a_file():
    return to_dict(synthetic_identification(samples=200))


@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_whatever_a_file_holds_it_loads_or_is_refused_by_name(tmp_path_factory, data):
    content = copy.deepcopy(content_of_a_file())
    *above, last = data.draw(st.sampled_from(list(places(content))))
    place = content
    for part in above:
        place = place[part]
    place[last] = data.draw(st.sampled_from(STRANGE))
    file = tmp_path_factory.mktemp("strange") / "identification.json"
    file.write_text(json.dumps(content))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # numbers near the largest
        try:
            loaded = load_identification(file)
        except IdentificationFileError as error:
            assert "\n" not in str(error)
        else:
            assert loaded.summary()


def test_intervals_of_warnings_come_back(tmp_path):
    inertia = Quantity(-0.002, "kg m²", interval=(-0.0045, 0.0002))
    warning = Finding(
        "warning", "physics", "negative", "ia5 is negative.", evidence={"ia5": inertia}
    )
    loaded = saved(tmp_path, replace(synthetic_identification(), warnings=(warning,)))
    assert loaded.warnings == (warning,)


def test_how_its_logs_were_read_and_the_fitted_range_come_back(tmp_path):
    reading = {
        "columns": {"q": ["q1", "q2"], "tau": {"file": "f", "columns": "effort"}, "t": "time"},
        "units": {"q": "deg", "tau": [{"unit": "A", "gain": 2.5}, "N m"]},
        "side": {"q": "joint", "tau": "motor"}, "rate": None, "resample": True,
        "samples_axis": None, "position_offset": [0.5, 0.0], "control_rate": 1000.0,
    }  # fmt: skip
    made = replace(synthetic_identification(), readings=(reading,))
    loaded = saved(tmp_path, made)
    assert loaded.readings == (reading,)
    (record,) = made.recordings
    used = record.used.any(axis=1)
    assert loaded.fitted_range.low == pytest.approx(record.q[used].min(axis=0))
    assert loaded.fitted_range.speed == pytest.approx(np.abs(record.dq[used]).max(axis=0))
    again = saved(tmp_path, loaded)
    assert plain(again.fitted_range) == plain(loaded.fitted_range)
