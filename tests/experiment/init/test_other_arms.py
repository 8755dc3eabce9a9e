"""First files for records of arms that another program made: what their motion does not show."""

import re

import pytest

from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.draft import draft_experiment
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


def test_one_link_that_the_description_has_wrong_is_no_other_unit_of_torque(tmp_path):
    log = make_log(14, Setting(clock="regular", rate=200.0, seconds=30.0, torque_noise=0.002))
    table, robot = log.write(tmp_path)
    urdf = robot.read_text()
    head, last = urdf.split('<link name="link_6">')
    number = r'(mass value|ixx|iyy|izz)="([^"]*)"'
    last = re.sub(number, lambda m: f'{m[1]}="{4.0 * float(m[2])}"', last)
    robot.write_text(f'{head}<link name="link_6">{last}')
    draft = draft_experiment([table], str(robot), out=tmp_path / "experiment.toml")
    units = next(a for a in draft.assumptions if (a.table, a.key) == ("recording.units", "tau"))
    assert units.value == "N m"


@pytest.mark.parametrize("seed", [22, 25])
def test_half_a_sample_is_noticed_where_noise_is_larger(seed, tmp_path):
    """Torques at their instants, 1 % noise, 200 Hz: half a sample hides in the noise of the fit.

    Taken for torques that are held, they leave IDIM-IV at the full rate with 64 % of the truths in
    its 95 % intervals.
    """
    made = make_log(seed, Setting("regular", 200.0, 40.0, 0.5, 0.01, "none", 0.6))
    log, robot = made.write(tmp_path)
    draft = draft_experiment([log], str(robot), out=tmp_path / "experiment.toml")
    (line,) = (a for a in draft.assumptions if (a.table, a.key) == ("recording", "torque_timing"))
    assert line.value == "sampled" and "later than one that is held" in line.seen


@pytest.mark.parametrize(
    ("rate", "noise", "expected"), [(40.0, 0.3, "sampled"), (200.0, 0.3, None)]
)
def test_a_slow_log_that_leaves_the_instant_open_has_values_at_it(rate, noise, expected, tmp_path):
    """No loop holds a torque for 25 ms; one of 5 ms may be held, and a file says so where it is."""
    made = make_log(22, Setting("regular", rate, 12.0, 0.5, noise, "none", 0.6))
    log, robot = made.write(tmp_path)
    draft = draft_experiment([log], str(robot), out=tmp_path / "experiment.toml")
    lines = [a for a in draft.assumptions if (a.table, a.key) == ("recording", "torque_timing")]
    assert [line.value for line in lines] == [expected] * (expected is not None)
    assert all(line.sure == "assumed" and "for 25 ms" in line.seen for line in lines)
