"""``pivident gains``: from a log in amperes to the lines that make it a log in N m."""

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.estimation.drives.known_payload import Payload
from pivident.experiment.experiment import load_experiment
from pivident.loop.simulation.controllers import PD
from tests.planar_arm import nominal_parameters, planar_motion, planar_record
from tests.positions_only import write_positions

GAINS = np.array([12.0, 5.0])
PAYLOAD = Payload(1.2, (0.35, 0.0, 0.0), (0.001, 0.0, 0.0, 0.001, 0.0, 0.001))
LAW = PD(np.array([500.0, 500.0]), np.array([15.0, 12.0]))
RATE, SAMPLES = 1000.0, 8000

HEAD = """
robot = "planar_2r"

[recording]
files = "empty.csv"
columns = {t = "time", q = ["q1", "q2"], q_ref = ["r1", "r2"], tau = ["i1", "i2"]}
units = {q = "deg", q_ref = "deg", tau = "A"}

[controller]
type = "pd"
kp = [500, 500]
kd = [15, 12]
"""

LOADED = """
[[gains.recording]]
files = "loaded.csv"
columns = {t = "time", q = ["q1", "q2"], q_ref = ["r1", "r2"], tau = ["i1", "i2"]}
units = {q = "deg", q_ref = "deg", tau = "A"}

[gains.payload]
mass = 1.2
center_of_mass = [0.35, 0, 0]
inertia = [0.001, 0, 0, 0.001, 0, 0.001]
"""


def write_log(path, loaded: bool, warm: bool = False) -> None:
    base, theta = nominal_parameters()
    if loaded:
        theta = theta + PAYLOAD.base_columns(base) @ PAYLOAD.known()
    rng = np.random.default_rng(2 + loaded)
    q_ref = planar_motion(rng, RATE, SAMPLES)
    q, tau = planar_record(
        base, theta, q_ref, RATE, rng, law=LAW, drive_gain=GAINS, encoder_noise=2e-7
    )
    time = np.arange(SAMPLES) / RATE
    kelvin = 30.0 * time / time[-1]
    strength = 1.0 - 0.002 * kelvin if warm else np.ones(SAMPLES)
    current = tau / GAINS / strength[:, None] + 0.01 * rng.standard_normal(q_ref.shape)
    np.savetxt(
        path,
        np.column_stack([time, np.rad2deg(q), np.rad2deg(q_ref), current, 20.0 + kelvin]),
        fmt="%.9g",
        delimiter=",",
        header="time,q1,q2,r1,r2,i1,i2,celsius",
        comments="",
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("amperes")
    write_log(made / "empty.csv", loaded=False)
    write_log(made / "loaded.csv", loaded=True)
    write_log(made / "warm.csv", loaded=False, warm=True)
    return made


def run(folder, text, *options) -> int:
    path = folder / "arm.toml"
    path.write_text(text, encoding="utf-8")
    return main(["gains", str(path), *map(str, options)])


def test_with_a_payload_the_lines_turn_the_log_into_newton_metres(folder, capsys):
    assert run(folder, HEAD + LOADED, "--out", folder / "lines.toml") == 0
    printed = capsys.readouterr().out
    assert (
        "Known: the gains of shoulder, elbow, by the payload of 1.2 kg: an error of 1 %" in printed
    )
    assert "N m/A" in printed and "none given" in printed
    lines = (folder / "lines.toml").read_text("utf-8")
    assert lines.strip() in printed
    text = HEAD.replace('robot = "planar_2r"', "").strip()
    (folder / "ready.toml").write_text(f"{lines}\n{text}\n", encoding="utf-8")
    ready = load_experiment(folder / "ready.toml")
    np.testing.assert_allclose(ready.robot.transmission.drive_gain, GAINS, rtol=0.01)
    assert ready.robot.transmission.gain_given.all()
    # the log can now be read in N m
    assert np.abs(ready.recordings()[0].tau).max() > 10.0


def test_without_a_payload_it_says_which_ratio_is_known(folder, capsys):
    assert run(folder, HEAD) == 0
    printed = capsys.readouterr().out
    assert "not known" in printed and "Not known: the common scale of shoulder, elbow" in printed
    assert "k(" in printed and "a run with a known payload" in printed
    assert "For the experiment file" not in printed


def test_rows_in_units_of_the_log(folder, capsys):
    assert run(folder, HEAD, "--in-log-units") == 0
    assert "kg m²/(N m/A)" in capsys.readouterr().out


def test_weighted_and_total_least_squares_beside_it(folder, capsys):
    assert run(folder, HEAD + LOADED, "--least-squares") == 0
    table = capsys.readouterr().out.split("white noise only:\n")[1].splitlines()
    assert "weighted least squares" in table[0] and "commands noisy" in table[0]
    for line, gain in zip(table[1:3], GAINS, strict=True):
        cells = line.split("±")
        weighted, mixed = float(cells[0].split()[1]), float(cells[2].split()[-1])
        assert mixed == pytest.approx(gain, rel=0.01)
        assert weighted < mixed
        assert line.endswith("N m/A")
    assert run(folder, HEAD, "--least-squares") == 0
    assert "they need a known payload" in capsys.readouterr().out


def test_a_trusted_gain_anchors_the_other(folder, capsys):
    assert run(folder, HEAD + "\n[gains]\ntrusted = {elbow = 5.0}\ntrusted_within = 0.01\n") == 0
    printed = capsys.readouterr().out
    assert "Known: the gains of shoulder, elbow, by the trusted elbow: an error of 1 %" in printed
    gain = float(printed.splitlines()[1].split()[1])
    assert gain == pytest.approx(GAINS[0], rel=0.03)


def test_declared_gains_get_their_ratio(folder, capsys):
    text = HEAD.replace('tau = "A"', 'tau = {unit = "A", gain = 10.0}')
    text = text.replace("kp = [500, 500]\nkd = [15, 12]", "kp = [5000, 5000]\nkd = [150, 120]")
    loaded = LOADED.replace('tau = "A"', 'tau = {unit = "A", gain = 10.0}')
    assert run(folder, text + loaded) == 0
    printed = capsys.readouterr().out
    row = printed.splitlines()[1].split()
    assert float(row[1]) == pytest.approx(GAINS[0], rel=0.01)
    assert "1.2" in printed and 'unit = "A", gain = 1' in printed


def test_temperature_from_the_log(folder, capsys):
    text = HEAD.replace("empty.csv", "warm.csv")
    text += '\n[gains]\ntemperature = "celsius"\nreference_temperature = 20.0\n'
    assert run(folder, text) == 0
    printed = capsys.readouterr().out
    table = printed[printed.index("Motor constants") :].splitlines()
    assert "%/K" in table[1]
    for line in table[2:4]:
        cells = line.split()
        assert float(cells[1]) == pytest.approx(-0.2, abs=1.5 * float(cells[2]) + 1e-6)
    assert table[2].split()[5] == "yes"


def test_payload_without_its_recordings_is_refused(folder, capsys):
    assert run(folder, HEAD + "\n[gains.payload]\nmass = 1.0\n") == 1
    assert "belong together" in capsys.readouterr().err


def test_nothing_is_written_where_nothing_is_known(folder, capsys):
    assert run(folder, HEAD, "--out", folder / "none.toml") == 1
    assert "no gain is known" in capsys.readouterr().err
    assert not (folder / "none.toml").exists()


@pytest.mark.parametrize("gain", [-12.0, 0.0])
def test_a_trusted_gain_is_positive(folder, capsys, gain):
    assert run(folder, f"{HEAD}\n[gains.trusted]\nshoulder = {gain}\n") == 1
    assert "greater than 0" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_told_before_the_work(folder, capsys):
    (folder / "file").write_text("")
    assert run(folder, HEAD, "--out", folder / "file" / "gains.toml") == 1
    errors = capsys.readouterr().err
    assert "file" in errors and "smoothing" not in errors and "bug in pivident" not in errors


def test_a_log_without_torque_has_no_commands(tmp_path, capsys):
    experiment = write_positions(tmp_path)
    assert main(["gains", str(experiment)]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "drive gains follow from logged commands" in said
    assert 'drive_gain = "unknown"' in said
