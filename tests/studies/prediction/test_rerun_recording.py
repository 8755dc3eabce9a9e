"""The motion of a log in Rerun: read back, the arm stands where it stood."""

import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pivident.app.cli import main
from pivident.robot.closed_chains import link_frames
from pivident.robot.gallery import load_robot
from pivident.studies.prediction.rerun_recording import poses
from tests.planar_log import EXPERIMENT, planar_log, write_experiment


@pytest.fixture(scope="module")
def planar(tmp_path_factory):
    """An identified planar arm and its log."""
    folder = tmp_path_factory.mktemp("planar")
    path = write_experiment(folder, EXPERIMENT + "[output]\nreport = false\n")
    assert main(["identify", str(path), "--folds", "0", "--out", str(folder / "results")]) == 0
    return folder


def export(*tokens: object) -> int:
    return main(["export", *map(str, tokens), "--to", "rrd"])


def columns_of(path) -> dict[str, dict[str, np.ndarray]]:
    """Columns of all entities by their names, as Rerun reads them."""
    chunk = pytest.importorskip("rerun.chunk")
    found: dict[str, dict[str, np.ndarray]] = {}
    for one in chunk.RrdReader(path).stream().to_chunks():
        batch = one.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            entity = found.setdefault(str(one.entity_path), {})
            values = column.to_pylist()
            entity[name] = [*entity.get(name, []), *values]
    return found


def values(entity: dict, ending: str) -> np.ndarray:
    """Values of the column of an entity whose name ends so, in the order of time."""
    (column,) = (c for name, c in entity.items() if name.endswith(ending))
    (time,) = (c for name, c in entity.items() if name == "time")
    seconds = np.array([getattr(t, "total_seconds", lambda t=t: t)() for t in time])
    order = np.argsort(seconds)
    return seconds[order], np.array([np.ravel(column[k]) for k in order], dtype=float)


def test_read_back_it_is_the_motion_and_the_torques(planar, capsys):
    pytest.importorskip("rerun")
    out = planar / "arm.rrd"
    log = planar / "experiment.toml"
    assert export(planar / "results", "--log", log, "--out", out) == 0
    assert "rerun" in capsys.readouterr().out
    entities = columns_of(out)
    data = planar_log()
    t, measured = values(entities["/log/torque/elbow/measured"], "scalars")
    assert measured.size == t.size > 1000
    # The torque is that of the log, without what is quicker than the motion.
    logged = np.interp(t, data[:, 0], data[:, 6])
    assert np.corrcoef(logged, measured[:, 0])[0, 1] > 0.999
    t, modelled = values(entities["/log/torque/elbow/modelled"], "scalars")
    residual = values(entities["/log/residual/elbow"], "scalars")[1]
    assert residual == pytest.approx(measured - modelled)
    assert np.std(residual) < 0.05 * np.std(measured)
    # The frames of both links, composed as Rerun does it, against those of the package.
    robot = load_robot("planar_2r")
    pairs = []
    for path in ("/log/arm/shoulder", "/log/arm/shoulder/elbow"):
        times, places = values(entities[path], "translation")
        pairs.append((places, Rotation.from_quat(values(entities[path], "quaternion")[1])))
    (place, turn), (further, turn_on) = pairs
    for k in (0, 100, times.size - 1):
        q = [np.deg2rad(np.interp(times[k], data[:, 0], data[:, c])) for c in (1, 2)]
        expected = link_frames(robot, np.array(q))[1]
        assert place[k] + turn[k].apply(further[k]) == pytest.approx(expected.translation, abs=1e-3)
        assert (turn[k] * turn_on[k]).as_matrix() == pytest.approx(expected.rotation, abs=2e-3)


def test_slides_move_along_their_axes():
    robot = load_robot("emps")
    q = np.array([[0.0], [0.25]])
    places, turns = poses(robot, q)
    for k in range(2):
        frame = link_frames(robot, q[k])[0]
        assert places[k, 0] == pytest.approx(frame.translation)
        assert Rotation.from_quat(turns[k, 0]).as_matrix() == pytest.approx(frame.rotation)


@pytest.mark.parametrize(
    ("tokens", "part"),
    [
        (["--out", "x.rrd"], "name its log"),
        (["--out", "x.txt", "--log", "log.csv"], "with .rrd"),
        (["--out", "x.rrd", "--log", "log.csv", "--free"], "leave it out"),
        (["--out", "x.rrd", "--log", "absent.csv"], "absent.csv"),
    ],
)
def test_refusals_say_what_to_do(planar, tokens, part, capsys, monkeypatch):
    pytest.importorskip("rerun")
    monkeypatch.chdir(planar)
    assert export("results", *tokens) == 1
    assert part in capsys.readouterr().err
    assert not (planar / "x.rrd").exists()


def test_other_formats_take_no_log(planar, capsys, monkeypatch):
    monkeypatch.chdir(planar)
    tokens = ["results", "--to", "json", "--out", "x.json", "--log", "log.csv"]
    assert main(["export", *tokens]) == 1
    assert "--log is for --to rrd" in capsys.readouterr().err


def test_without_rerun_the_extra_is_named(planar, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    monkeypatch.chdir(planar)
    assert export("results", "--log", "log.csv", "--out", "x.rrd") == 1
    assert "pip install 'pivident[rerun]'" in capsys.readouterr().err
