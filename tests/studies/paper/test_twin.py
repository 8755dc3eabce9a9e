"""The twin is what it says it is: truth from Table 1, gains from the bandwidth, counts, motions."""

import numpy as np
import pytest

from pivident.dynamics.forward import mass_matrix
from pivident.loop.simulation.joint_loop import JointLoop, joint_feedbacks
from pivident.studies.many.study.bench import Bench
from pivident.studies.paper.claims import FRICTION
from pivident.studies.paper.experiment import READINGS, condition, condition_numbers
from pivident.studies.paper.published import COLUMNS, published_table, stated


@pytest.fixture(scope="module")
def bench():
    return Bench(condition("joint"))


def test_the_table_has_the_figures_that_the_paper_speaks_of():
    table = published_table()
    assert len(table) == 28 and {len(row.value) for row in table} == {len(COLUMNS)}
    ratios = np.array([row.relative_std["piv"] / row.relative_std["iv"] for row in table])
    assert np.sum(ratios < 1.0) == 26
    assert np.exp(np.log(ratios).mean()) == pytest.approx(0.63, abs=0.01)
    rows = {row.name: row.value for row in table}
    assert rows["zz1r"]["ls"] / rows["zz1r"]["piv"] - 1.0 == pytest.approx(-0.10, abs=0.01)
    assert rows["zz3r"]["ls"] == -0.01 and rows["zz3r"]["piv"] == 0.14
    assert all({fv, fc} <= rows.keys() for fv, fc in FRICTION)


@pytest.mark.parametrize("reading", READINGS)
def test_the_truth_is_the_last_column_of_the_known_law(reading):
    bench = Bench(condition(reading))
    table = {row.name: row.value["piv"] for row in published_table()}
    assert dict(zip(bench.estimated, bench.expected, strict=True)) == table


def test_gains_are_those_of_the_stated_bandwidth(bench):
    content, robot = bench.scenario.content, bench.scenario.robot
    reach = np.array(content.trajectory.reach)
    postures = np.random.default_rng(1).uniform(-reach, reach, (20_000, robot.size))
    inertia = mass_matrix(robot, bench.heads, bench.true_values, postures)
    assert np.linalg.eigvalsh(inertia).min() > 0.0
    largest = np.diagonal(inertia, axis1=1, axis2=2).max(axis=0)
    omega = 2.0 * np.pi * stated()["bandwidth"]
    np.testing.assert_allclose(content.controller.kp, largest * omega**2, rtol=0.01)
    np.testing.assert_allclose(content.controller.kd, 1.4 * largest * omega, rtol=0.01)
    np.testing.assert_allclose(content.controller.ki, 2.0 * np.array(content.controller.kp))
    feedbacks = joint_feedbacks(bench.controller, content.record.rate, robot.size)
    viscous = [bench.truth[f"fv{j}"] for j in range(1, 7)]
    for inertia_, friction, feedback in zip(largest, viscous, feedbacks, strict=True):
        loop = JointLoop(float(inertia_), float(friction), feedback)
        assert loop.is_stable and 8.0 < loop.bandwidth < 45.0


def test_counts_of_the_motor_are_those_of_the_joint_times_the_gear(bench):
    ratio = np.abs(np.diag(bench.scenario.robot.transmission.reduction))
    joint, motor = (np.array(Bench(condition(r)).noise.count) for r in ("joint", "motor"))
    np.testing.assert_allclose(joint, 2.0 * np.pi / 3600)
    np.testing.assert_allclose(joint / motor, ratio)


def test_all_motions_have_the_condition_number_and_length_of_the_paper(bench):
    said, content = stated(), bench.scenario.content
    numbers = np.array(condition_numbers(bench)) / said["condition_number"]
    assert len(numbers) == 20
    assert 0.75 <= min(numbers) and max(numbers) <= 1.25
    q, *_ = bench.reference_of_record(3)
    assert len(q) == said["samples"] and content.record.rate == said["rate"]
    band = content.identify.bandpass
    assert (band.cutoff, band.bandwidth) == (said["cutoff"], said["decimation"])
    assert len(q) * 2 * band.bandwidth / said["rate"] == said["rows"]
    assert content.noise.counts == said["points_per_revolution"]
    first = bench.reference_of_record(0)[0]
    assert not np.array_equal(q, first)
    np.testing.assert_array_equal(bench.reference_of_record(20)[0], first)


def test_the_reading_log_rounds_the_record_only():
    rounded, fine = Bench(condition("joint")).loop, Bench(condition("log")).loop
    assert rounded.counts(6).all() and not fine.counts(6).any()
    q = Bench(condition("log")).recording(0).q
    counts = q / (2.0 * np.pi / 3600)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
