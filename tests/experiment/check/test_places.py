"""Where a check says that something is changed: tables and keys of the experiment file."""

import numpy as np
import pytest

from pivident.experiment.check.experiment_check import check_experiment
from tests.questions.material import (
    EXPERIMENT,
    URDF,
    URDF_EXPERIMENT,
    csv,
    log,
    replaced,
    short_log,
    with_table,
)

ARM = 'name = "arm"\n[[joints]]\nname = "shoulder"\nmodel = "gear"\n'
FILES = 'files = "log.csv"'
MODEL = '"planar_2r"'
METHODS = 'methods = ["ls"]'


def places(folder, text, columns=None):
    """Headings of all that would stop an identification."""
    (folder / "log.csv").write_text(csv(columns or short_log()))
    (folder / "arm.urdf").write_text(URDF)
    (folder / "arm.toml").write_text(ARM)
    (folder / "experiment.toml").write_text(text)
    return {r.heading for r in check_experiment(folder / "experiment.toml").remarks if r.refused}


def swap(old, new, place, text=EXPERIMENT):
    return pytest.param(replaced((old, new), text=text), place, id=f"{new[:40]}")


@pytest.mark.parametrize(
    ("text", "place"),
    [
        # keys of the robot's file are none of the experiment's, whatever their names
        swap(MODEL, '"arm.toml"', "line 1, [robot] model"),
        swap(MODEL, '{model = "planar_2r", couplings = [{motor = "1", joint = "1"}]}',
             "line 1, [robot] couplings"),
        swap(MODEL, '{model = "planar_2r", reduction_matrix = [[1, 0]]}',
             "line 1, [robot] reduction_matrix"),
        swap(MODEL, '{model = "planar_2r", position_offset = [1]}',
             "line 1, [robot] position_offset"),
        swap(MODEL, '{model = "planar_2r", joint_friction = {wrist = ["load"]}}',
             "line 1, [robot] joint_friction"),
        swap(MODEL, '{model = "planar_2r", joint_friction = {elbow = ["load", "load"]}}',
             "line 1, [robot] joint_friction.elbow"),
        swap(MODEL, '{model = "planar_2r", friction = ["viscous", "stribeck"]}',
             "line 1, [robot] friction"),
        swap('"arm.urdf"', '"arm.urdf", frozen = {wrist = 0}', "line 1, [robot] frozen.wrist",
             URDF_EXPERIMENT),
        # a column of one channel, the clock, the part
        swap('t = "time"', 't = "seconds"', "line 5, [recording] columns.t"),
        swap('["r1", "r2"]', '["r1", "r3"]', "line 5, [recording] columns.q_ref"),
        swap('tau = ["', 'inputs = {g = "gravity"}, tau = ["',
             "line 5, [recording] columns.inputs.g"),
        swap('t = "time"', 't = {speed = "time"}', "line 5, [recording] columns.t"),
        swap(FILES, f"{FILES}\nunits = {{t = 'min'}}", "line 5, [recording] units.t"),
        swap(FILES, f"{FILES}\nunits = {{inputs = {{g = 'A'}}}}",
             "line 5, [recording] units.inputs.g"),
        swap(FILES, f"{FILES}\nunits = {{q = {{unit = 'counts', per_revolution = 0}}}}",
             "line 5, [recording] units.q.per_revolution"),
        swap(FILES, f"{FILES}\ndelay = nan", "line 5, [recording] delay"),
        swap(FILES, f"{FILES}\npart = [0, 0.005]", "line 5, [recording] part"),
        swap(FILES, f"{FILES}\nresample = true\nrate = 1e9", "line 6, [recording] rate"),
        # methods, parameters, bounds
        swap(METHODS, f"{METHODS}\nnoise = {{period = 3}}", "line 14, [identify] noise.period"),
        swap(METHODS, f"{METHODS}\nls = {{random_walk = {{}}}}",
             "line 14, [identify] ls.random_walk"),
        swap(METHODS, f"{METHODS}\ninitial = {{no = 1}}", "line 14, [identify] initial"),
        pytest.param(
            with_table("[consistency]\nprior = 'none'\nreference = 'emps'"),
            "line 16, [consistency] reference",
            id="reference",
        ),
        pytest.param(
            with_table("[consistency]\ntotal_mass = [1, 2]\nbounds.forearm.mass = [3, 4]"),
            "line 15, [consistency] total_mass",
            id="total mass",
        ),
    ],
)  # fmt: skip
def test_the_place_is_that_of_the_key(tmp_path, text, place):
    assert place in places(tmp_path, text)


def test_a_stamp_that_is_missing_is_one_of_the_time_column(tmp_path):
    columns = short_log()
    columns["time"][70] = np.nan
    assert places(tmp_path, EXPERIMENT, columns) >= {"line 5, [recording] columns.t"}


def test_a_rate_that_contradicts_the_stamps_is_the_one_that_was_given(tmp_path):
    text = replaced((FILES, f"{FILES}\nrate = 200"))
    assert places(tmp_path, text, log()) == {"line 5, [recording] rate"}


def test_words_of_a_message_are_no_keys(tmp_path):
    """The unknown column is called like a key that stands in the table."""
    text = replaced((FILES, f'{FILES}\nrate = 1000\nname = "run"'), ('"tau2"', '"rate"'))
    assert places(tmp_path, text) == {"line 7, [recording] columns.tau"}
