"""The command line: results, exit codes, error lines, and nothing half-written."""

import html
import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest

from pivident import __version__
from pivident.app.cli import main, workflow
from pivident.app.cli.app import GROUPS, app
from pivident.estimation.methods import METHODS
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.common_work import NUMBERS
from pivident.foundation.errors import SimulationDiverged
from pivident.models.consistency.options import CONSISTENT_METHODS
from tests.conftest import REPOSITORY
from tests.interrupts import heed_ctrl_c
from tests.planar_log import EXPERIMENT, planar_truth, write_experiment


@pytest.fixture
def experiment(tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    return write_experiment(folder)


def run(*tokens: object) -> int:
    return main([str(token) for token in tokens])


def error_of(capsys) -> str:
    """The last line on standard error, which must be the only error line."""
    lines = capsys.readouterr().err.strip().splitlines()
    assert sum(line.startswith("error:") for line in lines) == 1
    assert not any("Traceback" in line for line in lines)
    return lines[-1]


def files_in(folder) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


def test_version_and_help(capsys):
    assert run("--version") == 0
    assert capsys.readouterr().out.strip() == __version__
    assert run("--help") == 0
    text = capsys.readouterr().out
    assert all(command in text for command in ("demo", "identify", "robots", "datasets"))


def test_help_lists_every_command_under_its_heading(capsys):
    """With its first line, although its module is imported only where it is run."""
    assert run("--help") == 0
    panels = re.split(r"╭─ (.*?) ─+╮", capsys.readouterr().out)[1:]
    shown = dict(zip(panels[::2], panels[1::2], strict=True))
    assert list(shown) == [*GROUPS, "The command line"]
    for heading, commands in GROUPS.items():
        rows = re.findall(r"^│ (\S+) +(\S.*?) *│$", shown[heading], flags=re.MULTILINE)
        assert [name for name, _ in rows] == list(commands), heading
        for name, words in rows:
            assert (app[name].help or "").startswith(words), name
    assert re.findall(r"^│ (\S+)", shown["The command line"], flags=re.MULTILINE) == [
        "completion", "--help", "--version",
    ]  # fmt: skip


def test_a_command_imports_no_other():
    code = (
        "import sys; from pivident.app.cli import main; main(['robots', '--help']); "
        "print(*(m for m in sys.modules if m.startswith('pivident.app.cli.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = done.stdout.splitlines()[-1].split()
    assert "pivident.app.cli.robots" in imported
    others = {place.partition(":")[0] for group in GROUPS.values() for place in group.values()}
    assert not (others - {"pivident.app.cli.robots"}) & set(imported)


def test_estimates_and_predictions_do_without_half_of_scipy(experiment, tmp_path):
    """Its filters, splines and distributions take as long as an identification."""
    results = tmp_path / "results"
    commands = (
        ["identify", str(experiment), "--method", "piv", "--folds", "2", "--out", str(results)],
        ["predict", str(results), str(experiment)],
        ["check", str(experiment)],
    )
    code = (
        f"import sys; from pivident.app.cli import main; [main(c) for c in {commands!r}]; "
        "slow = ['scipy.' + own for own in ('interpolate', 'ndimage', 'signal', 'stats')]; "
        "print([name for name in (*slow, 'pandas') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (results / "identification.json").is_file(), done.stderr
    assert "held-out" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"


def test_help_of_identify_names_six_methods_and_the_page_of_all(capsys):
    assert run("identify", "--help") == 0
    words = " ".join(capsys.readouterr().out.replace("│", " ").split())
    text = words.partition("--method -m")[2].partition("--folds")[0]
    named = [name for name in (*METHODS, *CONSISTENT_METHODS) if f" {name} " in text]
    assert named == ["ls", "iv", "iv-full-rate", "piv", "ml", "pc-piv"]
    assert "docs/reference/methods.md lists all" in text
    assert (REPOSITORY / "docs" / "reference" / "methods.md").is_file()


def test_one_method_writes_its_files_and_the_report(experiment, tmp_path, capsys):
    out = tmp_path / "out"
    assert run("identify", experiment, "--out", out) == 0
    assert files_in(out) == {"identification.json", "parameters.csv", "report.html", "verdict.json"}
    content = json.loads((out / "identification.json").read_text())
    assert content["method"] == "IDIM-WLS" and content["converged"]
    assert [p["name"] for p in content["parameters"]] == list(planar_truth())
    printed = capsys.readouterr()
    assert "not fitted" in printed.out and "Verdict: " not in printed.out
    assert json.loads((out / "verdict.json").read_text("utf-8"))["method"] == "IDIM-WLS"
    assert str(out / "report.html") in printed.out
    assert "reading the recordings" in printed.err


@pytest.mark.parametrize("methods", ["piv", "ls,iv-full-rate,piv"])
def test_no_warning_is_said_twice(tmp_path, capsys, methods):
    """Assumed scales and a virtual law, which estimator, verdict and report all know."""
    scale = '{unit = "A", gain = 1.0, scale = "assumed"}'
    masses = '{unit = "A", gain = 0.9, scale = "masses"}'
    text = EXPERIMENT.replace('tau = "N m"', f"tau = [{scale}, {masses}]")
    text = text.replace('type = "pd"\nkp = [6000, 2500]\nkd = [180, 60]', 'type = "virtual_pd"')
    out = tmp_path / "out"
    path = write_experiment(tmp_path, text)
    assert run("identify", path, "-m", methods, "--folds", "2", "--out", out) in (0, 3)
    printed = capsys.readouterr()
    page = (out / "report.html").read_text("utf-8")
    shown = re.sub(r"<script.*?</script>", " ", page, flags=re.DOTALL)
    words = " ".join(html.unescape(re.sub(r"<[^>]+>", "", shown)).split())
    sentences = {
        sentence
        for s in json.loads((out / "verdict.json").read_text("utf-8"))["statements"]
        for sentence in re.split(r"(?<=[a-z)])\. ", f"{s['message']} {s['next_step']}")
        if s["severity"] in ("warning", "error") and len(sentence) > 40
    }
    assert len(sentences) >= 3
    both = printed.out + printed.err
    assert all(both.count(s) <= 1 for s in sentences)
    # in full where all reservations stand, and in the head those that come first
    counts = {s: words.count(s.replace("`", "")) for s in sentences}
    assert set(counts.values()) <= {1, 2}, counts


@pytest.mark.parametrize(
    "method", [["--method", "ls,iv-full-rate"], ["-m", "ls", "-m", "iv-full-rate"]]
)
def test_several_methods_get_a_folder_each(experiment, tmp_path, capsys, method):
    assert run("identify", experiment, *method, "--out", tmp_path / "out", "--details") == 0
    names = {"identification.json", "parameters.csv"}
    expected = {f"{m}/{n}" for m in ("ls", "iv-full-rate") for n in names}
    expected |= {"report.html", "verdict.json"}
    assert files_in(tmp_path / "out") == expected
    out = capsys.readouterr().out
    assert "IDIM-WLS" in out and "IDIM-IV (full rate)" in out


def test_output_of_the_file_and_by_default(tmp_path, monkeypatch, capsys):
    text = EXPERIMENT + '[output]\nfolder = "mine"\nreport = false\n'
    assert run("identify", write_experiment(tmp_path, text)) == 0
    assert files_in(tmp_path / "mine") == {"identification.json", "parameters.csv", "verdict.json"}
    monkeypatch.chdir(tmp_path)
    write_experiment(tmp_path)
    assert run("identify", "experiment.toml") == 0
    assert "report.html" in files_in(tmp_path / "experiment-results")
    assert "report.html" in capsys.readouterr().out


def test_not_converged_has_its_own_exit_code(tmp_path, capsys):
    text = EXPERIMENT.replace(
        'methods = ["ls"]', 'methods = ["iv-full-rate"]\nmax_iterations = 1\ntolerance = 1e-9'
    )
    path = write_experiment(tmp_path, text)
    assert run("identify", path, "--out", tmp_path / "out") == 3
    assert "report.html" in files_in(tmp_path / "out")
    assert "NOT CONVERGED" in capsys.readouterr().err


def test_a_failing_method_does_not_take_the_others_with_it(tmp_path, capsys):
    text = EXPERIMENT.replace("kp = [6000, 2500]\nkd = [180, 60]", "kp = [1e9, 1e9]\nkd = [0, 0]")
    path = write_experiment(tmp_path, text)
    assert run("identify", path, "-m", "ls,iv", "--out", tmp_path / "out") == 1
    assert "report.html" in files_in(tmp_path / "out")
    assert "check the controller's gains" in capsys.readouterr().err


def test_a_failing_method_alone_writes_nothing(tmp_path, capsys):
    text = EXPERIMENT.replace("kp = [6000, 2500]\nkd = [180, 60]", "kp = [1e9, 1e9]\nkd = [0, 0]")
    path = write_experiment(tmp_path, text)
    assert run("identify", path, "-m", "piv", "--out", tmp_path / "out") == 1
    assert "check the controller's gains" in error_of(capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("tokens", "code", "part"),
    [
        (["nonsense"], 2, "Unknown command"),
        (["identify"], 2, "EXPERIMENT"),
        (["identify", "x.toml", "--ouut", "y"], 2, "--ouut"),
        (["identify", "x.toml", "--method", "livv"], 2, "'iv'"),
        (["identify", "x.toml", "--method", ","], 2, "names no method"),
        (["demo", "--seed", "many"], 2, "many"),
        (["identify", "absent.toml"], 1, "absent.toml: cannot be read"),
        (["robots", "tx4"], 1, "no robot 'tx4'"),
        (["robots", "absent.urdf"], 1, "absent.urdf"),
        (["datasets", "fetch", "empss"], 1, "no data set 'empss'"),
    ],
)
def test_errors_are_one_line_with_an_exit_code(tokens, code, part, capsys):
    assert run(*tokens) == code
    assert part in error_of(capsys)


def test_error_with_evidence_says_which_file(experiment, capsys):
    (experiment.parent / "log.csv").unlink()
    assert run("identify", experiment) == 1
    line = error_of(capsys)
    assert "log.csv cannot be opened" in line and "experiment.toml: [recording]" in line


def test_output_that_is_a_file_is_refused_before_any_work(experiment, tmp_path, capsys):
    (tmp_path / "taken").write_text("mine")
    assert run("identify", experiment, "--out", tmp_path / "taken" / "deeper") == 1
    printed = capsys.readouterr()
    assert "is a file" in printed.err and "reading" not in printed.err
    assert (tmp_path / "taken").read_text() == "mine"


def test_unexpected_error_is_a_line_unless_debugging(experiment, monkeypatch, capsys):
    def fail(*args, **kwargs):
        raise ZeroDivisionError("surprise")

    monkeypatch.setattr(workflow, "identify", fail)
    monkeypatch.delenv("PIVIDENT_DEBUG", raising=False)
    assert run("identify", experiment) == 1
    line = error_of(capsys)
    assert "unexpected ZeroDivisionError: surprise" in line and "PIVIDENT_DEBUG=1" in line
    monkeypatch.setenv("PIVIDENT_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        run("identify", experiment)


@pytest.mark.parametrize("where", ["identify", "save_identification"])
def test_interrupt_leaves_nothing_behind(experiment, tmp_path, monkeypatch, capsys, where):
    out = tmp_path / "out"

    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(workflow, where, interrupt)
    before = files_in(tmp_path)
    assert run("identify", experiment, "--out", out) == 130
    assert files_in(tmp_path) - {f"in/{NUMBERS}"} == before and not out.exists()
    assert "interrupted" in capsys.readouterr().err


def test_a_report_that_fails_takes_no_result_away_and_leaves_no_earlier_page(
    experiment, tmp_path, monkeypatch, capsys
):
    out = tmp_path / "out"
    assert run("identify", experiment, "--out", out) == 0
    earlier = (out / "report.html").read_bytes()
    (out / "identification.json").unlink()

    def diverge(*args, **kwargs):
        raise SimulationDiverged("shoulder", 1.0, 2.0, 0.5)

    monkeypatch.setattr("pivident.judgement.report.builder.write_report", diverge)
    assert run("identify", experiment, "--out", out) == 1
    assert "The report could not be written: " in capsys.readouterr().err
    assert load_identification(out).converged
    page = (out / "report.html").read_bytes()
    assert page != earlier and b"could not be written" in page


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_a_real_process_cleanly(tmp_path, sent):
    command = [sys.executable, "-m", "pivident", "demo", "--out", str(tmp_path / "out")]
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        preexec_fn=heed_ctrl_c,
    )
    assert "simulating" in process.stderr.readline()
    time.sleep(0.3)
    process.send_signal(sent)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "interrupted" in errors and "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_closed_pipe_is_no_error():
    code = (
        "import sys; from pivident.app.cli import main; sys.exit(main(['robots', 'staubli_tx40']))"
    )
    writer = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    writer.stdout.close()
    assert writer.wait(timeout=120) == 0
    assert "Traceback" not in writer.stderr.read()


def test_robots(capsys):
    assert run("robots") == 0
    assert "staubli_tx40" in capsys.readouterr().out
    assert run("robots", "staubli_tx40") == 0
    text = capsys.readouterr().out
    assert "61 base parameters" in text and "iam6" in text
    assert "zz1 + ia1 + yy2 + yy3 + 0.07 mz3" in text
    assert "the motor of joint_6 also turns with joint_5" in text
    assert "150 s/rad" in text and "fv dq + fc (2/π) atan(γ dq) + off" in text


def test_robot_from_a_urdf(tmp_path, capsys):
    from tests.experiment.test_experiment import URDF

    (tmp_path / "pair.urdf").write_text(URDF)
    assert run("robots", tmp_path / "pair.urdf") == 0
    text = capsys.readouterr().out
    assert "revolute" in text and "375 s/rad" in text and "not given" in text
    assert "nominal inertia is zero (IV and PIV start from it): l1, l2" in text


def test_datasets_are_listed_without_network(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PIVIDENT_DATA", str(tmp_path))
    monkeypatch.setattr("pivident.data.recording.datasets._cache", lambda name: tmp_path / "cache")
    assert run("datasets") == 0
    text = capsys.readouterr().out
    assert "emps" in text and "pivident datasets fetch emps" in text and "Licence" in text


@pytest.mark.record
def test_fetch_takes_what_is_here(data_dir, monkeypatch, capsys):
    monkeypatch.setenv("PIVIDENT_DATA", str(data_dir))
    assert run("datasets", "fetch", "emps") == 0
    assert "DATA_EMPS.mat" in capsys.readouterr().out


def test_demo_compares_with_the_truth(tmp_path, capsys):
    assert run("demo", "--out", tmp_path / "out") == 0
    assert {"report.html", "piv/identification.json"} <= files_in(tmp_path / "out")
    text = capsys.readouterr().out
    assert "IDIM-PIV" in text and str(tmp_path / "out") in text
    assert "Next       pivident init your_log.csv --robot your_arm.urdf" in text
    verdicts = [line for line in text.splitlines() if "true values within 2σ" in line]
    assert len(verdicts) == 4
    # its truth is a machine that can exist
    assert "Good for torque prediction and simulation." in text


def test_free_corrects_with_the_estimate(tmp_path, capsys):
    """Of two joints that both turn freely only the ratio of their gains is known."""
    text = EXPERIMENT.replace('tau = "N m"', 'tau = [{unit = "N m", gain = 1.1}, "N m"]')
    path = write_experiment(tmp_path, text)
    options = ("-m", "piv", "--folds", "0")
    free = ("--free", "torque-gain,delay")
    assert run("identify", path, *options, *free, "--out", tmp_path / "a") == 0
    said = capsys.readouterr().out
    assert "Corrected with the estimate: excess of the logged torques of" in said
    stored = json.loads((tmp_path / "a" / "identification.json").read_text("utf-8"))
    notes = [w for w in stored["warnings"] if w["topic"] == "correction"]
    assert {w["kind"] for w in notes} == {"torque gain", "delay"}
    (gain,) = (w for w in notes if w["kind"] == "torque gain")
    expected = {"shoulder": 10.0, "elbow": 100.0 / 1.1 - 100.0}
    assert abs(gain["evidence"]["size"]["value"] - expected[gain["subject"]]) < 0.1
    other = next(joint for joint in expected if joint != gain["subject"])
    assert gain["severity"] == "warning"
    assert f"cannot tell it from torque gain of {other}" in gain["message"]
    text = text.replace("methods =", 'free = ["torque-gain"]\nmethods =')
    path = write_experiment(tmp_path, text)
    assert run("identify", path, *options, "--out", tmp_path / "b") == 0
    assert "excess of the logged torques of" in capsys.readouterr().out


def test_free_of_an_unknown_kind_names_the_nearest(experiment, tmp_path, capsys):
    assert run("identify", experiment, "--free", "gear-ration", "--out", tmp_path / "out") == 1
    assert "gear ratio" in capsys.readouterr().err
