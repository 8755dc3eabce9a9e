"""First files for records of arms that another program made: what their motion does not show."""

from pivident.experiment.experiment import load_experiment
from pivident.init.draft import draft_experiment
from tests.other_arms import Setting, make_log


def test_one_factor_that_nearly_nothing_shows_is_no_other_unit(tmp_path):
    """Only the inertia of the first axis gives its factor: 0.44 with a standard error of 0.12."""
    log, robot = make_log(
        236, Setting("alternating", 2000 / 11, 30.0, 0.0, 0.02, "none", 0.5)
    ).write(tmp_path)
    out = tmp_path / "experiment.toml"
    out.write_text(draft_experiment([log], str(robot), out=out).text, encoding="utf-8")
    (entry,) = load_experiment(out).content.recording
    assert entry.units.tau == "N m"
