"""A log with gaps: the check says what is left of it, and what it says can be done."""

import re

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.experiment import load_experiment
from tests.questions.material import EXPERIMENT, csv, log


@pytest.fixture
def folder(tmp_path):
    """An arm whose logger paused from 1 to 1.4 s."""
    holed = {name: np.delete(x, np.s_[1000:1400]) for name, x in log().items()}
    (tmp_path / "log.csv").write_text(csv(holed))
    (tmp_path / "experiment.toml").write_text(EXPERIMENT)
    return tmp_path


def test_the_check_goes_on_between_the_gaps(folder):
    found = check_experiment(folder / "experiment.toml")
    (gap,) = [r for r in found.remarks if r.kind == "gap"]
    assert (
        gap.severity == "warning"
        and not gap.refused
        and "400 sample(s) are missing in 1 gap" in gap.message
    )
    assert not any(r.kind == "lost" for r in found.remarks)
    assert [row[1] for row in found.plan.recordings] == [999, 1799]
    (folder / "experiment.toml").write_text(EXPERIMENT.replace("kp = [6000", "kp = [100"))
    kinds = [r.kind for r in check_experiment(folder / "experiment.toml").remarks]
    assert "gain" in kinds


def test_both_stretches_are_used_or_the_one_that_is_named(folder):
    (gap,) = [r for r in check_experiment(folder / "experiment.toml").remarks if r.kind == "gap"]
    (longest,) = re.findall(r"part = \[[^]]+\]", gap.next_step)
    path = folder / "cut.toml"
    path.write_text(EXPERIMENT.replace("[recording]", f"[recording]\n{longest}"))
    for name, samples in (("experiment.toml", [999, 1799]), ("cut.toml", [1799])):
        assert not check_experiment(folder / name).refused
        experiment = load_experiment(folder / name)
        problem = experiment.problem()
        assert [r.samples for r in problem.recordings] == samples
        assert identify(problem, experiment.methods()["ls"]).relative_error < 0.01


def test_stamps_that_are_resampled_are_not_wrong(tmp_path):
    columns = log()
    columns["time"] = columns["time"] + 2.5e-4 * np.random.default_rng(1).uniform(-1, 1, 3200)
    (tmp_path / "log.csv").write_text(csv(columns))
    path = tmp_path / "experiment.toml"
    path.write_text(EXPERIMENT)
    assert check_experiment(path).refused
    path.write_text(EXPERIMENT.replace("[recording]", "[recording]\nresample = true"))
    assert not any(r.topic == "timing" for r in check_experiment(path).remarks)
