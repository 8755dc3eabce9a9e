import csv
import io

import numpy as np
import pytest

from pivident.data.logs.described_log import described_log
from pivident.data.logs.file_columns import read_columns
from pivident.studies.excitation.design import PAGE_RATE, postures_csv, sample_arrays, samples_csv
from tests.studies.excitation.designs import made_design, named


@pytest.mark.parametrize("robot", ["planar_2r", "staubli_tx40", "emps"])
def test_samples_are_read_back_as_a_log(robot, tmp_path):
    design = made_design(robot, "splines")
    file = tmp_path / "motion.csv"
    file.write_text(samples_csv(design, 250.0), encoding="utf-8")
    columns = read_columns(file)
    unit = "rad" if robot != "emps" else "m"
    np.testing.assert_allclose(columns["t [s]"], design.motion.times(250.0), atol=1e-12)
    signals = design.motion.sampled(250.0)
    stems = (("q", unit), ("dq", f"{unit}/s"), ("ddq", f"{unit}/s^2"))
    for (stem, own), signal in zip(stems, signals, strict=True):
        for j, name in enumerate(design.robot.joint_names):
            np.testing.assert_allclose(
                columns[f"{stem}_{name} [{own}]"], signal[:, j], rtol=1e-10, atol=1e-14
            )
    assert len(columns) == 1 + 3 * design.robot.size


def test_a_log_of_the_motion_gives_its_positions_back(tmp_path):
    design = named(made_design("planar_2r"), 'a,"b"', "c [d]")
    file = tmp_path / "motion.csv"
    file.write_text(samples_csv(design, 500.0), encoding="utf-8")
    names = design.robot.joint_names
    log = described_log(
        file,
        {
            "t": "t [s]",
            "q": [f"q_{name} [rad]" for name in names],
            "tau": [f"ddq_{name} [rad/s^2]" for name in names],
        },
        robot=design.robot,
    )
    np.testing.assert_allclose(log.channels["q"], design.motion.sampled(500.0)[0], atol=1e-11)


def test_arrays_are_the_motion():
    arrays = sample_arrays(made_design(), PAGE_RATE)
    assert set(arrays) == {"t", "q", "dq", "ddq", "joint_names"}
    assert list(arrays["joint_names"]) == ["shoulder", "elbow"]
    np.testing.assert_allclose(np.gradient(arrays["q"], arrays["t"], axis=0)[5:-5],
                               arrays["dq"][5:-5], atol=5e-3)  # fmt: skip


@pytest.mark.parametrize("robot", ["staubli_tx40", "emps"])
def test_postures_are_listed_in_units_of_pendants_and_in_si(robot):
    design = made_design(robot, "postures")
    rows = list(csv.DictReader(io.StringIO(postures_csv(design))))
    postures = design.motion.postures
    assert [int(row["posture"]) for row in rows] == list(range(1, len(postures) + 1))
    unit, si, scale = ("mm", "m", 1e3) if robot == "emps" else ("deg", "rad", 180.0 / np.pi)
    for j, name in enumerate(design.robot.joint_names):
        typed = [float(row[f"q_{name} [{unit}]"]) for row in rows]
        exact = [float(row[f"q_{name} [{si}]"]) for row in rows]
        np.testing.assert_allclose(exact, postures[:, j], rtol=1e-10)
        np.testing.assert_allclose(typed, scale * postures[:, j], atol=5.1e-5)
    assert rows[0]["move duration [s]"] == "" and rows[0]["speed [% of rated speed]"] == ""
    total = sum(float(row["move duration [s]"]) + 0.05 for row in rows[1:])
    assert total == pytest.approx(design.motion.duration, abs=0.02)


def test_the_share_of_the_speed_is_that_of_the_motion():
    """Each move's largest speed, from samples of the motion, over the rated speed."""
    design = made_design("staubli_tx40", "postures")
    rows = list(csv.DictReader(io.StringIO(postures_csv(design))))
    _, dq, _ = design.motion.sampled(5000.0)
    t = design.motion.times(5000.0)
    period = design.motion.duration / design.motion.family.size
    for k, row in enumerate(rows[1:]):
        own = (t >= k * period) & (t < (k + 1) * period)
        share = (np.abs(dq[own]) / design.robot.rated_speeds).max()
        assert float(row["speed [% of rated speed]"]) == pytest.approx(100.0 * share, rel=1e-3)
