"""Files of one run with stamps of their own, as topics that were exported one by one."""

import numpy as np
import pytest

from pivident.data.recording.load import load_recording
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.assumption import DraftError
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.errors import BadCell
from pivident.robot.gallery import load_robot
from tests.planar_log import planar_log

EPOCH = 1764240000.0


def write(path, columns):
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, fmt="%.9f", delimiter=",", header=",".join(columns), comments="")
    return path


@pytest.fixture
def exported(tmp_path):
    """Joint states at 500 Hz; setpoints at 250 Hz, later, numbered in the controller's order."""
    table = planar_log()
    states, setpoints = table[::2], table[5::4]
    joints = {"shoulder": (1, 5), "elbow": (2, 6)}
    columns = {"__time": EPOCH + states[:, 0]}
    for name in sorted(joints):
        q, tau = joints[name]
        columns[f"/joint_states/{name}/position"] = np.radians(states[:, q])
        columns[f"/joint_states/{name}/effort"] = states[:, tau]
    wanted = {"__time": EPOCH + setpoints[:, 0]}
    for number, column in enumerate((3, 4)):  # of shoulder and elbow
        wanted[f"/arm/state/desired/positions[{number}]"] = np.radians(setpoints[:, column])
        wanted[f"/arm/state/actual/positions[{number}]"] = np.radians(setpoints[:, column - 2])
    return write(tmp_path / "joint_states.csv", columns), write(tmp_path / "state.csv", wanted)


def drafted(files, path):
    draft = draft_experiment(files, "planar_2r", out=path)
    assert not draft.troubles
    path.write_text(draft.text)
    return path


@pytest.mark.parametrize("order", [1, -1])
def test_the_draft_reads_both_files(exported, tmp_path, order):
    path = drafted(exported[::order], tmp_path / "experiment.toml")
    entry = load_experiment(path).content.recording[0]
    assert entry.files == {"q": "joint_states.csv", "q_ref": "state.csv"}
    assert entry.resample and entry.columns.t == dict.fromkeys(("q", "tau", "q_ref"), "__time")
    (recording,) = load_experiment(path).problem().recordings
    assert recording.joint_names == ("shoulder", "elbow")
    assert recording.rate == pytest.approx(500.0, rel=1e-3)
    table = planar_log()
    t = recording.start_time - EPOCH + np.arange(recording.samples) / recording.rate
    for j in range(2):
        np.testing.assert_allclose(
            recording.q_ref[50:-50, j],
            np.interp(t, table[:, 0], np.radians(table[:, 3 + j]))[50:-50],
            atol=2e-4,
        )


def test_numbered_setpoints_go_to_the_joints_that_follow_them(exported, tmp_path):
    """The joint states are in alphabetical order, elbow first; number 0 is the shoulder's."""
    entry = load_experiment(drafted(exported, tmp_path / "one.toml")).content.recording[0]
    assert entry.columns.q_ref == [f"/arm/state/desired/positions[{k}]" for k in range(2)]
    text = exported[1].read_text().replace("positions[0]", "x").replace("positions[1]", "y")
    exported[1].write_text(text.replace("/x", "/positions[1]").replace("/y", "/positions[0]"))
    entry = load_experiment(drafted(exported, tmp_path / "other.toml")).content.recording[0]
    assert entry.columns.q_ref == [f"/arm/state/desired/positions[{k}]" for k in (1, 0)]


def test_joints_that_move_alike_keep_their_references(exported, tmp_path):
    """Each follows both: which one by 1e-6 better is no reason to exchange them."""
    states, setpoints = exported
    twins = {
        states: [("/joint_states/shoulder/position", "/joint_states/elbow/position")],
        setpoints: [(f"/arm/state/{k}/positions[0]", f"/arm/state/{k}/positions[1]")
                    for k in ("desired", "actual")],
    }  # fmt: skip
    for path, pairs in twins.items():
        names = path.read_text().splitlines()[0].split(",")
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        for name, twin in pairs:
            own = 2e-3 * np.sin(5.0 * (table[:, 0] - EPOCH))
            table[:, names.index(twin)] = table[:, names.index(name)] + own
        write(path, dict(zip(names, table.T, strict=True)))
    entry = load_experiment(drafted(exported, tmp_path / "alike.toml")).content.recording[0]
    assert entry.columns.q_ref == [f"/arm/state/desired/positions[{k}]" for k in (1, 0)]


def test_files_of_other_times_are_refused(exported, tmp_path):
    columns = np.genfromtxt(exported[1], delimiter=",", names=True)
    late = {name: columns[name] for name in columns.dtype.names}
    names = exported[1].read_text().splitlines()[0].split(",")
    late = dict(zip(names, late.values(), strict=True))
    late["__time"] = late["__time"] + 3600.0
    write(exported[1], late)
    with pytest.raises(DraftError, match=r"differ in their rows .* no stamps of the same time"):
        draft_experiment(exported, "planar_2r", out=tmp_path / "experiment.toml")


def test_topics_of_different_rates_in_one_table_are_to_be_exported_apart(exported, tmp_path):
    """A merged export has a row for each message, with empty cells for the other topic."""
    tables = [np.genfromtxt(path, delimiter=",", names=True) for path in exported]
    names = [path.read_text().splitlines()[0].split(",") for path in exported]
    widths = [len(own) - 1 for own in names]
    rows = [(row[0], [*map(repr, list(row)[1:]), *[""] * widths[1]]) for row in tables[0].tolist()]
    rows += [(row[0], [*[""] * widths[0], *map(repr, list(row)[1:])]) for row in tables[1].tolist()]
    merged = tmp_path / "merged.csv"
    lines = [",".join([repr(t), *cells]) for t, cells in sorted(rows)]
    merged.write_text("\n".join([",".join([*names[0], *names[1][1:]]), *lines]) + "\n")
    with pytest.raises(BadCell, match=r"empty, as \d+ % of the column") as caught:
        load_recording(
            merged,
            columns={"t": "__time", "q": [names[0][1], names[0][3]], "tau": names[0][2::2]},
            robot=load_robot("planar_2r"),
        )
    assert "export each topic to a file of its own" in str(caught.value)
