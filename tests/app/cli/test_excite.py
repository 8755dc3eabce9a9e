"""``pivident excite``, and its way back: identify with the design beside the record."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import pivident as pv
from pivident.app.cli import main
from pivident.studies import load_design, write_design
from pivident.studies.excitation.design_view import next_commands
from tests.interrupts import heed_ctrl_c
from tests.planar_arm import LAW
from tests.planar_log import planar_log
from tests.studies.excitation.designs import made_design, named

FILES = {
    "design.html", "design.json", "motion.csv", "motion.npz", "trajectory.yaml",
    "trajectory_slow.yaml",
}  # fmt: skip

EXPERIMENT = """
robot = "planar_2r"

[recording]
files = "motion/log.npz"
columns = {t = "t", q = "q", q_ref = "q_ref", tau = "tau"}

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]

[identify]
methods = ["ls", "piv"]
"""


#: How long motions are searched for, which are good enough for all that is asked of them here.
SECONDS = "0.25"


def run(*tokens: object) -> int:
    return main([str(token) for token in tokens])


def excite(*options: object) -> int:
    return run("excite", "planar_2r", "--seconds", SECONDS, "--duration", "6", *options)


def files_in(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def designed(tmp_path_factory):
    """A folder with a design, the log of its motion in it, and an experiment file."""
    made = tmp_path_factory.mktemp("circle")
    (made / "cell.toml").write_text("[excite]\ntorque_noise = [0.1, 0.05]\n")
    out = made / "motion"
    assert excite("--cell", made / "cell.toml", "--out", out) == 0
    write_log(out / "log.npz", load_design(out).motion.sampled(1000.0)[0])
    (made / "experiment.toml").write_text(EXPERIMENT, encoding="utf-8")
    return made


def write_log(path: Path, reference: np.ndarray, noise=(0.5, 0.25)) -> None:
    """The log of a reference, which the simulated arm follows after half a second."""
    robot = pv.load_robot("planar_2r")
    reference = np.vstack([reference[:1].repeat(500, 0), reference])
    record = pv.simulate(
        robot, pv.Loop(LAW), reference, rate=1000, encoder=2e-6, torque=np.array(noise), seed=4
    ).recording
    np.savez(path, t=record.t, q=record.q, q_ref=record.q_ref, tau=record.tau)


def copied(designed: Path, folder: Path) -> Path:
    """The same log without its design."""
    (folder / "motion").mkdir()
    (folder / "motion/log.npz").write_bytes((designed / "motion/log.npz").read_bytes())
    (folder / "experiment.toml").write_text(EXPERIMENT, encoding="utf-8")
    return folder / "experiment.toml"


def quickly(experiment: Path, out: Path) -> int:
    return run("identify", experiment, "-m", "ls", "--folds", "0", "--out", out)


def test_a_design_is_printed_and_written(folder, capsys):
    assert excite() == 0
    printed = capsys.readouterr().out
    assert printed.startswith("6 s spline motion") and "σ predicted" in printed
    assert printed.rstrip().endswith("in motion")
    assert files_in(folder / "motion") == FILES
    assert all(name in printed for name in FILES)
    design = load_design("motion")
    rows = np.genfromtxt("motion/motion.csv", delimiter=",", names=True, comments="#")
    assert len(rows) == 6001
    assert design.motion.duration == 6.0


def test_options_reach_the_design(folder):
    options = ["--for", "fc1, fc2", "--start", "0.3,-0.4", "--motion", "postures", "--rate", "100"]
    assert excite(*options, "--out", "wrist") == 0
    design = load_design("wrist")
    assert [p.name for p in design.predicted if p.wanted] == ["fc1", "fc2"]
    assert design.motion.kind == "postures" and design.criterion.startswith("worst of fc1, fc2")
    np.testing.assert_array_equal(design.motion.start, [0.3, -0.4])
    assert np.load("wrist/motion.npz")["t"].size == 601
    assert "postures.csv" in files_in(folder / "wrist")


def test_an_existing_folder_keeps_its_other_files(folder):
    (folder / "motion").mkdir()
    (folder / "motion/notes.txt").write_text("mine")
    assert excite("--out", "motion") == 0
    assert files_in(folder / "motion") == FILES | {"notes.txt"}
    assert load_design("motion").robot.size == 2
    assert (folder / "motion/notes.txt").read_text() == "mine"


def test_a_design_is_never_replaced(folder, capsys):
    """Its record may lie beside it, and would be compared with another motion."""
    (folder / "motion").mkdir()
    (folder / "motion/design.json").write_text("old")
    assert excite("--out", "motion") == 1
    assert "motion holds a design, and may hold its record" in capsys.readouterr().err
    assert (folder / "motion/design.json").read_text() == "old"


def test_joints_of_a_urdf_stand_still(folder, capsys):
    """A finger that follows another one has to be frozen before there is any record."""
    limit = '<limit lower="-1" upper="1" effort="9" velocity="2"/>'
    links = "".join(
        f'<link name="l{k}"><inertial><mass value="1"/><origin xyz="0.2 0 0"/><inertia ixx="1" '
        'iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for k in range(4)
    )
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<axis xyz="0 0 1"/>{limit}{mimic}</joint>'
        for k, mimic in enumerate(("", "", '<mimic joint="j1"/>'))
    )
    (folder / "arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>')
    options = ("arm.urdf", "--seconds", SECONDS, "--duration", "6")
    assert run("excite", *options) == 1
    assert "frozen" in capsys.readouterr().err
    assert run("excite", *options, "--frozen", "j2=0.1") == 0
    assert load_design("motion").robot.joint_names == ("j0", "j1")
    for wrong in ("j2", "j2=x", "=1"):
        assert run("excite", *options, "--frozen", wrong) == 1
        assert "such as finger_1=0.02" in capsys.readouterr().err


@pytest.mark.parametrize(("goal", "code"), [("20%", 0), ("0.001%", 3)])
def test_a_goal_that_is_missed_shows_in_the_exit_code(folder, capsys, goal, code):
    assert excite("--for", "fc1", "--to", goal) == code
    assert ("No motion of up to 6 s reaches" in capsys.readouterr().out) == bool(code)
    assert load_design("motion").robot.size == 2


def test_a_start_may_begin_with_a_minus(folder):
    assert excite("--start", "-0.2,0.1") == 0
    np.testing.assert_array_equal(load_design("motion").motion.start, [-0.2, 0.1])


@pytest.mark.parametrize("rate", ["0", "-5", "nan"])
def test_a_rate_that_means_nothing_is_refused_before_the_search(folder, capsys, rate):
    assert excite(f"--rate={rate}") == 1
    said = capsys.readouterr().err
    assert "the rate is" in said and "searching" not in said


def test_a_folder_that_is_there_is_left_alone_unless_it_is_named(folder):
    (folder / "motion").mkdir()
    assert excite() == 0
    assert list((folder / "motion").iterdir()) == [] and files_in(folder / "motion-2") == FILES


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--to", "soon", "--for", "fc1"], 1, "--to soon is no number"),
        (["--to", "2%"], 1, "a goal needs the parameters"),
        (["--start", "here"], 1, "--start here is not a list of numbers"),
        (["--start", "0.1"], 1, "start has 1 positions"),
        (["--for", "fc3"], 1, "no parameter 'fc3'; did you mean 'fc"),
        (["--motion", "sine"], 1, "no motion 'sine'"),
        (["--criterion", "e"], 1, "no criterion 'e'"),
        (["--duration", "1"], 1, "the duration is 1 s"),
        (["--seconds", "-1"], 1, "cannot take -1 s"),
        (["--rate", "-5"], 1, "the rate is -5 Hz"),
        (["--after", "absent"], 1, "absent"),
        (["--cell", "absent.toml"], 1, "absent.toml"),
        (["--duration", "long"], 2, "long"),
        (["--durations", "5"], 2, "pivident excite --help"),
    ],
)
def test_bad_options_end_with_one_line_and_write_nothing(options, code, said, folder, capsys):
    given = ["--seconds", "0.2", *options] if "--seconds" not in options else options
    assert run("excite", "planar_2r", *given) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert sum(line.startswith("error:") for line in lines) == 1
    assert said in lines[-1]
    assert list(folder.iterdir()) == []


def test_a_robot_that_there_is_not_names_the_nearest(folder, capsys):
    assert run("excite", "planar_2x") == 1
    assert "planar_2r" in capsys.readouterr().err
    assert run("excite") == 2


def test_an_out_that_is_a_file_is_refused_before_the_search(folder, capsys):
    (folder / "motion").write_text("mine")
    begin = time.perf_counter()
    assert run("excite", "planar_2r", "--seconds", "300", "--out", "motion") == 1
    assert time.perf_counter() - begin < 60.0
    assert "motion is a file" in capsys.readouterr().err


def test_unknown_keys_of_the_table_name_the_nearest(folder, capsys):
    Path("cell.toml").write_text("[excite]\ntorque_nois = 1.0\n")
    assert run("excite", "planar_2r", "--cell", "cell.toml") == 1
    assert "torque_noise" in capsys.readouterr().err


def test_check_reports_an_unknown_key_with_the_nearest(designed, folder, capsys):
    path = copied(designed, folder)
    for text, nearest in (
        ("[excite]\ncriterium = 'd'\n", "criterion"),
        ("[excite.joint.elbow]\nacceleraton = 1.0\n", "acceleration"),
        ("[[excite.obstacle]]\nname = 'a'\nshape = 'bax'\n", "box"),
        ("[recording2]\n", "recording"),
    ):
        path.write_text(f"{EXPERIMENT}\n{text}", encoding="utf-8")
        assert run("check", path) == 1
        said = capsys.readouterr()
        assert f"Did you mean {nearest!r}" in said.out + said.err, text
    path.write_text(f"{EXPERIMENT}\n[excite]\ncriterion = 'd'\n", encoding="utf-8")
    assert run("check", path) == 0


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_writes_the_best_motion_so_far(tmp_path):
    command = [sys.executable, "-m", "pivident", "excite", "planar_2r", "--seconds", "300"]
    process = subprocess.Popen(
        [*command, "--duration", "6"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        start_new_session=True,
        preexec_fn=heed_ctrl_c,
    )
    line = ""
    while not line.startswith("searching"):
        line = process.stderr.readline()
        assert line, "it ended by itself"
    time.sleep(1.0)  # of 300
    process.send_signal(signal.SIGINT)
    printed, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors and "Files: design.json" in printed
    assert files_in(tmp_path / "motion") == FILES


def test_identify_prints_predicted_beside_reached(designed, capsys):
    out = designed / "results"
    assert run("identify", designed / "experiment.toml", "--out", out) == 0
    printed = capsys.readouterr().out
    design = load_design(designed / "motion")
    assert "reached/predicted" in printed and "log followed the design" in printed
    (found,) = json.loads((out / "design_check.json").read_text("utf-8"))["designs"]
    predicted = {p.name: p.std for p in design.predicted}
    rows = {p["name"]: p for p in found["parameters"]}
    assert list(rows) == list(predicted)
    for name, row in rows.items():
        assert row["predicted"] == pytest.approx(predicted[name])
        assert row["ratio"] == pytest.approx(row["reached"] / row["predicted"])
    best = json.loads((out / "verdict.json").read_text("utf-8"))["name"]
    content = json.loads((out / best / "identification.json").read_text("utf-8"))
    assert found["method"] == content["method"]
    # noise models of 6 s scatter: 0.82 to 1.13 over eleven seeds
    assert found["ratio"] == pytest.approx(1.0, abs=0.3)
    assert found["recordings"][0]["starts"] == [pytest.approx(0.5, abs=0.01)]
    text = (out / "design_check.txt").read_text("utf-8").strip()
    assert text in printed
    page = (out / "report.html").read_text("utf-8")
    assert 'id="designed-motion"' in page and "Reached/predicted" in page


def test_the_verdict_ends_with_the_command_of_the_next_motion(designed, folder, capsys):
    """So much noise that parameters that matter are open; little leaves none, and no command."""
    path = copied(designed, folder)
    reference = load_design(designed / "motion").motion.sampled(1000.0)[0]
    assert quickly(path, Path("quiet")) == 0
    assert "Next " not in capsys.readouterr().out
    write_log(folder / "motion/log.npz", reference, noise=(25.0, 12.0))
    assert quickly(Path("experiment.toml"), Path("my results")) == 0
    lines = capsys.readouterr().out.strip().splitlines()
    (last,) = [line for line in lines if line.startswith("Next ")]
    command = shlex.split(last.removeprefix("Next "), comments=True)
    content = json.loads(Path("my results/verdict.json").read_text("utf-8"))
    assert command[:3] == ["pivident", "excite", "my results"] and "'my results'" in last
    assert command[3:] == ["--for", ",".join(content["open"])]
    page = Path("my results/report.html").read_text("utf-8")
    assert "pivident excite &#39;my results&#39; --for" in page
    # and that command runs
    assert run(*command[1:], "--out", "next", "--seconds", SECONDS, "--duration", "6") == 0
    design = load_design("next")
    assert [p.name for p in design.predicted if p.wanted] == content["open"]
    # the page does not offer a result for the robot of `pivident init`
    assert next_commands(design)[0].startswith("pivident init record.csv --robot ROBOT ")
    assert all(p.std < p.before for p in design.predicted)
    assert all(p.std < p.alone for p in design.predicted)


def test_a_design_may_be_named_in_the_file(designed, folder, capsys):
    path = copied(designed, folder)
    assert quickly(path, folder / "none") == 0
    assert "reached/predicted" not in capsys.readouterr().out
    assert not (folder / "none/design_check.json").exists()
    named_file = os.path.relpath(designed / "motion", folder)
    for given in (named_file, f"{named_file}/design.json"):
        key = f'[recording]\ndesign = "{given}"'
        path.write_text(EXPERIMENT.replace("[recording]", key), encoding="utf-8")
        assert run("check", path) == 0
        assert quickly(path, folder / "out") == 0
        assert "log followed the design" in capsys.readouterr().out


def test_a_record_of_another_motion_says_so(designed, folder, capsys):
    path = copied(designed, folder)
    write_design(load_design(designed / "motion"), folder / "motion", 100.0)
    write_log(folder / "motion/log.npz", np.deg2rad(planar_log()[:6000, 3:5]))
    assert quickly(path, folder / "out") == 0
    printed = capsys.readouterr().out
    assert "holds another motion than the design" in printed
    assert "reached/predicted" not in printed


def test_a_design_of_another_robot_is_skipped_with_the_reason(designed, folder, capsys):
    path = copied(designed, folder)
    write_design(named(made_design(), "a", "b"), folder / "motion", 100.0)
    assert quickly(path, folder / "out") == 0
    assert "another robot, with the joints a, b" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("text", ["", "{}", '{"format": "pivident-design"', "\0"])
def test_a_damaged_design_is_a_note_and_ends_nothing(text, designed, folder, capsys):
    path = copied(designed, folder)
    (folder / "motion/design.json").write_text(text)
    assert quickly(path, folder / "out") == 0
    errors = capsys.readouterr().err
    assert errors.count("the design is not compared: ") == 1 and "design.json" in errors
    assert not (folder / "out/design_check.json").exists()


@pytest.mark.parametrize("command", ["check", "identify"])
def test_a_design_that_is_named_and_missing_is_refused(designed, folder, capsys, command):
    path = copied(designed, folder)
    key = '[recording]\ndesign = "absent/design.json"'
    path.write_text(EXPERIMENT.replace("[recording]", key), encoding="utf-8")
    assert run(command, path) == 1
    printed = " ".join("".join(capsys.readouterr()).split())
    assert "absent/design.json does not exist" in printed and "leave the key out" in printed


def test_without_the_package_the_design_is_a_note(designed, folder, monkeypatch, capsys):
    from importlib.util import find_spec

    from pivident.app.cli import console

    path = copied(designed, folder)
    (folder / "motion/design.json").write_bytes((designed / "motion/design.json").read_bytes())
    loaded = [name for name in sys.modules if name.startswith("pivident.studies.excitation")]
    for name in loaded:
        monkeypatch.delitem(sys.modules, name)

    class Absent:
        def find_spec(self, name, path=None, target=None):
            if name.startswith("pivident.studies.excitation"):
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(sys, "meta_path", [Absent(), *sys.meta_path])
    absent = "pivident.studies.excitation"
    monkeypatch.setattr(console, "find_spec", lambda n: None if n == absent else find_spec(n))
    assert quickly(path, folder / "out") == 0
    assert "this installation has no 'excitation'" in capsys.readouterr().err


def test_init_without_a_log_says_how_to_come_by_one(folder, capsys):
    assert run("init", "--robot", "my arm.urdf") == 2
    line = capsys.readouterr().err.strip()
    assert "pivident excite 'my arm.urdf' --out motion" in line
    assert "pivident init LOG --robot 'my arm.urdf'" in line
    assert run("init") == 2
    assert "pivident excite my_arm.urdf --out motion" in capsys.readouterr().err
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(("answer", "code", "designs"), [("yes", 0, 1), ("no", 2, 0), ("y", 0, 1)])
def test_init_without_a_log_offers_a_design_on_a_terminal(
    answer, code, designs, folder, monkeypatch, capsys
):
    from pivident.app.cli import init

    class Terminal:
        def isatty(self):
            return True

        def readline(self):
            return f"{answer}\n"

    asked = []
    monkeypatch.setattr(sys, "stdin", Terminal())
    monkeypatch.setattr(init, "excite", lambda robot: asked.append(robot) or 0)
    assert run("init", "--robot", "planar_2r") == code
    assert asked == ["planar_2r"] * designs
    assert "Design a motion for planar_2r now" in capsys.readouterr().err
    assert run("init", "--robot", "planar_2r", "--yes") == 2
    assert len(asked) == designs
