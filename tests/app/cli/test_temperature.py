"""`pivident identify` with columns of temperature, from the log to predictions."""

import json
import re

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.experiment.experiment import load_experiment
from tests.judgement.model_errors import warming_arm as arm

HEAD = "time,q1,q2,q3,tau1,tau2,tau3,T1,T2,T3"
EXPERIMENT = """
robot = "arm.urdf"

[recording]
files = "log.csv"
columns = {t = "time", q = ["q1", "q2", "q3"], tau = ["tau1", "tau2", "tau3"]}

[identify]
methods = ["ls"]
temperature = ["T1", "T2", "T3"]

[validation]
folds = 3
"""


def write(folder, text=EXPERIMENT, name="log.csv", seed=0, head=HEAD):
    """The log of one run, and the experiment file."""
    run = arm.recording(seed, 0.3, 8000)
    rows = np.column_stack([run.t, run.q, run.tau, run.temperature])[:, : head.count(",") + 1]
    np.savetxt(folder / name, rows, fmt="%.9g", delimiter=",", header=head, comments="")
    (folder / "arm.urdf").write_text(arm.URDF)
    path = folder / "experiment.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_verdict_states_the_change_and_predictions_follow_it(tmp_path, capsys):
    path = write(tmp_path)
    assert main(["identify", str(path), "--out", str(tmp_path / "out")]) == 0
    screen = capsys.readouterr().out
    assert "friction is that at 37.3 °C (j1), 33.2 °C (j2)." in " ".join(screen.split())
    verdict = (tmp_path / "out" / "verdict.json").read_text("utf-8")
    assert "the friction of j1 changes with its temperature, fv1 by -0.05" in verdict
    assert "the friction of j1 changes" in (tmp_path / "out" / "report.html").read_text("utf-8")
    stored = json.loads((tmp_path / "out" / "identification.json").read_text("utf-8"))
    assert {own["joint"] for own in stored["friction_warming"]} == {"j1", "j2"}
    write(tmp_path, name="new.csv", seed=1)
    write(tmp_path, name="cold.csv", seed=1, head=HEAD.partition(",T1")[0])
    for name, said in (("new.csv", "changed to that of the log"), ("cold.csv", "is not known")):
        assert main(["predict", str(tmp_path / "out"), str(tmp_path / name)]) == 0
        assert f"Friction of j1 is that at 37.3 °C, {'since' * (name == 'cold.csv')}" in (
            text := capsys.readouterr().out
        )
        assert said in text


def test_validation_recordings_are_brought_to_the_same_temperature(tmp_path, capsys):
    lines = EXPERIMENT.partition("[recording]\n")[2].splitlines()[:2]
    unseen = "\n".join(["[[validation.recording]]", *lines]).replace("log.csv", "new.csv")
    write(tmp_path, name="new.csv", seed=1)
    path = write(tmp_path, EXPERIMENT + unseen)
    assert main(["identify", str(path), "--out", str(tmp_path / "out")]) == 0
    screen = capsys.readouterr().out
    error = re.search(r"Torque on motion that was not fitted: (\S+) % off", screen)
    assert error is not None and float(error[1]) < 1.0


@pytest.mark.parametrize(
    ("columns", "own", "expected"),
    [
        ('"T2"', "", [1, 1, 1]),
        ('["T1", "T2", "T3"]', ', temperature = ["T3", "T2", "T1"]', [2, 1, 0]),
    ],
)
def test_one_column_for_all_and_columns_of_a_run_of_its_own(tmp_path, columns, own, expected):
    text = EXPERIMENT.replace('["T1", "T2", "T3"]', columns).replace('"tau3"]}', f'"tau3"]{own}}}')
    (recording,) = load_experiment(write(tmp_path, text)).recordings()
    logged = arm.temperatures(8000)[:, expected]
    np.testing.assert_allclose(recording.temperature, logged, rtol=1e-8)


def test_temperatures_beside_several_files_are_in_that_of_the_positions(tmp_path):
    text = EXPERIMENT.replace('"log.csv"', '{q = "log.csv", tau = "torque.csv"}')
    text = text.replace('t = "time"', 't = {q = "time", tau = "time"}')
    write(tmp_path, name="torque.csv")
    (recording,) = load_experiment(write(tmp_path, text)).recordings()
    np.testing.assert_allclose(recording.temperature, arm.temperatures(8000), rtol=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"T3"]', '"T4"]', "log.csv has no column or array 'T4'"),
        (', "T3"]', "]", "Temperature lists 2 column(s) for 3 joint(s) (j1, j2, j3)."),
        ('"T3"]', '"T3"]\nreference_temperature = 300', "reference_temperature is 300, but"),
    ],
)
def test_check_says_what_is_wrong_with_the_columns(tmp_path, capsys, old, new, said):
    assert main(["check", str(write(tmp_path, EXPERIMENT.replace(old, new)))]) == 1
    assert said in " ".join(capsys.readouterr().out.split())
