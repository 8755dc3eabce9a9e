"""Temperatures of the motors: recognised, used where they explain, missed where they lack."""

import numpy as np
import pytest

from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.text.toml import parse_toml
from tests.judgement.audit.test_friction_drift import warming

COURSE = np.linspace(0.0, 1.0, 8000) ** 0.7


def draft_of(folder, head, fall, *more, scale=1.0):
    """The draft of a log whose friction falls, and the line about temperatures."""
    t, q, tau = warming(COURSE, [fall, fall])
    path = folder / "log.csv"
    columns = np.column_stack([t, q, scale * tau, *more])
    np.savetxt(path, columns, delimiter=",", header=head, comments="")
    draft = draft_experiment([path], "planar_2r", out=folder / "experiment.toml")
    lines = [a for a in draft.assumptions if (a.table, a.key) == ("identify", "temperature")]
    return draft, lines[0] if lines else None


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        ("motor_temperature_1,motor_temperature_2", ["motor_temperature_1", "motor_temperature_2"]),
        ("Temp1 ,Temp2 ", ["Temp1", "Temp2"]),
        ("temperature_core_1,joint_temp", "joint_temp"),
    ],
)
def test_temperatures_of_currents_become_those_of_friction_and_gains(tmp_path, names, columns):
    head = f"t,q1,q2,current_1,current_2,{names}"
    warm = 25.0 + 15.0 * COURSE
    draft, line = draft_of(tmp_path, head, 0.2, warm, warm, scale=0.1)
    tables = parse_toml(draft.text)
    assert tables["gains"]["temperature"] == tables["identify"]["temperature"] == columns
    assert "go from 25 to 40" in line.seen and "friction of elbow falls by" in line.seen
    (tmp_path / "experiment.toml").write_text(draft.text, encoding="utf-8")
    (recording,) = load_experiment(tmp_path / "experiment.toml").recordings()
    assert recording.temperature.shape == recording.q.shape and not recording.inputs


def test_beside_torques_they_are_those_of_friction(tmp_path):
    head = "t,q1,q2,tau_1 (Nm),tau_2 (Nm),temperature_1,temperature_2"
    warm = 25.0 + 15.0 * COURSE
    draft, line = draft_of(tmp_path, head, 0.2, warm, warm)
    assert line.value == ["temperature_1", "temperature_2"]
    assert "identified at their mean" in line.seen and "gains" not in parse_toml(draft.text)


def test_a_temperature_that_explains_nothing_is_not_used(tmp_path):
    head = "t,q1,q2,tau_1,tau_2,temperature"
    draft, line = draft_of(tmp_path, head, 0.0, 25.0 + COURSE)
    assert line.value is None and "do not explain unseen motion better" in line.seen
    assert "temperature" not in parse_toml(draft.text)["identify"]
    assert '# temperature = "temperature"' in draft.text
    names = [f"actuators_of_the_arm_temperature_of_the_windings_of_motor_{k}" for k in (0, 1)]
    draft, _ = draft_of(
        tmp_path, f"t,q1,q2,tau_1,tau_2,{','.join(names)}", 0.0, *[25.0 + COURSE] * 2
    )
    assert f'# temperature = ["{names[0]}", "{names[1]}"]\n' in draft.text
    assert "temperature" not in parse_toml(draft.text)["identify"]


def test_a_temperature_that_lacks_is_named_where_friction_moves_with_time(tmp_path):
    _, line = draft_of(tmp_path, "t,q1,q2,tau_1,tau_2", 0.2)
    assert "no column of motor temperatures is recognised" in line.seen
    assert "friction of shoulder falls by" in line.seen and "warm the robot up" in line.seen
    assert draft_of(tmp_path, "t,q1,q2,tau_1,tau_2", 0.0)[1] is None
