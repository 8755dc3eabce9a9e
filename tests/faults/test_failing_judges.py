"""A judge that fails costs its own line: the three estimates are written and read back."""

import json
from functools import cache

import numpy as np
import pytest

from pivident.app.cli import main, workflow
from pivident.app.cli.identify import code_of
from pivident.estimation import answer
from pivident.estimation.identification_file import save_identification
from pivident.estimation.identify import identify
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.errors import Attempts, IdentificationError, in_words
from pivident.judgement.report.sections.motion import TorqueSection
from pivident.judgement.report.sections.verdict import VerdictSection
from tests.planar_log import EXPERIMENT, HEADER, planar_log

METHODS = ("ls", "iv-full-rate", "piv")

#: What is made to fail (without its room, which is `judgement`), and the line that it costs.
JUDGES = {
    "diagnostics.diagnostics.recording_faults": "The recordings could not be audited: ",
    "diagnostics.diagnostics.compare_out_of_sample": "Nothing could be held out: ",
    "validation.held_out.out_of_sample.JudgedMotion.of": "Nothing could be held out: ",
    "validation.held_out.out_of_sample._judged": "Nothing could be held out: ",
    "validation.held_out.cross_validation.estimates_without": "IDIM-IV (full rate) was not judged",
    "diagnostics.diagnostics.residual_tests": "IDIM-PIV: the residuals could not be tested: ",
    "diagnostics.diagnostics.instrument_tests": "IDIM-PIV: the instruments could not be tested: ",
    "diagnostics.diagnostics.model_error": "Noise and model error could not be separated: ",
    "diagnostics.diagnostics.named_causes": "Causes of model error were not looked for: ",
    "diagnostics.diagnostics.block_ranges": "The range of the estimates is not given: ",
    "diagnostics.diagnostics.make_consistent": "Whether a machine can have these parameters could",
    "diagnostics.verdict.determined": "Nothing is said about determined: ",
    "diagnostics.verdict.noise": "Nothing is said about noise: ",
    "diagnostics.verdict.prediction": "Nothing is said about prediction: ",
    "diagnostics.verdict.open_parameters": "No motion is designed for what is open: ",
    "diagnostics.verdict.HeldOutErrors.of": "Held-out errors are not stored: ",
    "diagnostics.consistent_estimate.consistent_estimate": "PC-IDIM-PIV: ",
    "diagnostics.consistent_estimate.consistent_prediction": "PC-IDIM-PIV was not judged on held",
    "diagnostics.stored_consistent.write_consistent": "PC-IDIM-PIV could not be written: ",
    "app.cli.workflow.torque_sums": "IDIM-WLS: what other parameters cost in torque is not stored",
    "app.cli.workflow.designs_beside": "The design is not compared: ",
    "app.cli.workflow.comparison_table": "Tables could not be printed: ",
    "report.sections.motion.TorqueSection.context": f'"{TorqueSection.title}" could not be written',
    "report.sections.verdict.VerdictSection.context": f'"{VerdictSection.title}" could not be',
    "report.builder.page_of": "The report could not be written: ",
}


@cache
def rows():
    return planar_log(3000)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "400")
    monkeypatch.delenv("PIVIDENT_DEBUG", raising=False)
    np.savetxt("log.csv", rows(), fmt="%.9g", delimiter=",", header=HEADER, comments="")
    write_experiment(tmp_path)
    return tmp_path


def write_experiment(folder, report=False):
    text = EXPERIMENT.replace('["ls"]', '["ls", "iv-full-rate", "piv", "pc-piv"]')
    text += f"\n[output]\nreport = {str(report).lower()}\n"
    (folder / "experiment.toml").write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def estimates():
    """Of each method, made once: what follows them is under test."""
    made = {}

    def once(problem, method, progress=None):
        if method.label not in made:
            made[method.label] = identify(problem, method)
        return made[method.label]

    return once


def failing(error, name="fail"):
    def fail(*args, **kwargs):
        raise error

    fail.__name__ = name
    return fail


def come_back(folder, estimates, names=METHODS):
    for name in names:
        loaded = load_identification(folder / "experiment-results" / name)
        assert loaded.theta.size == 13 and np.isfinite(loaded.theta).all()
    assert not list(folder.glob("**/.pivident-[0-9a-f]*"))


@pytest.mark.parametrize("place", JUDGES)
def test_a_judge_that_fails_costs_its_own_line(folder, estimates, monkeypatch, capsys, place):
    monkeypatch.setattr(workflow, "identify", estimates)
    error, name = np.linalg.LinAlgError("Singular matrix"), place.rpartition(".")[2]
    room = "pivident" if place.startswith("app.") else "pivident.judgement"
    monkeypatch.setattr(f"{room}.{place}", failing(error, name))
    if place.startswith("report"):
        write_experiment(folder, report=True)
    code = main(["identify", "experiment.toml", "--folds", "2", "--details"])
    said = capsys.readouterr()
    come_back(folder, estimates)
    lines = [line for line in said.err.splitlines() if JUDGES[place] in line]
    assert len(lines) == 1 and "LinAlgError: Singular matrix" in lines[0], said.err
    assert code == 1 and "Traceback" not in said.err
    assert "experiment-results" in said.out
    results = folder / "experiment-results"
    assert json.loads((results / "verdict.json").read_text("utf-8"))["name"] in METHODS
    assert (results / "report.html").is_file() == place.startswith("report")


@pytest.mark.parametrize(
    ("error", "words", "code"),
    [
        (IdentificationError("it cannot be"), "looked for: it cannot be.", 0),
        (KeyError("theta"), "unexpected KeyError: 'theta' (", 1),
        (MemoryError(), "unexpected MemoryError: no message", 1),
        (FloatingPointError("overflow"), "FloatingPointError: overflow", 1),
    ],
)
def test_a_line_says_what_kind_of_error_it_was(
    folder, estimates, monkeypatch, capsys, error, words, code
):
    monkeypatch.setattr(workflow, "identify", estimates)
    monkeypatch.setattr("pivident.judgement.diagnostics.diagnostics.named_causes", failing(error))
    assert main(["identify", "experiment.toml", "--folds", "0", "-m", ",".join(METHODS)]) == code
    said = capsys.readouterr()
    (line,) = [line for line in said.err.splitlines() if "Causes of model error were not" in line]
    assert words in line
    assert ("this is a bug in pivident" in line) == isinstance(error, KeyError | MemoryError)
    come_back(folder, estimates)
    verdict = json.loads((folder / "experiment-results" / "verdict.json").read_text("utf-8"))
    assert any(line.startswith(s["message"]) for s in verdict["statements"]), "it stands there too"


@pytest.mark.parametrize("failed", METHODS)
@pytest.mark.parametrize(
    "error", [np.linalg.LinAlgError("Singular matrix"), TypeError("no number"), MemoryError()]
)
def test_a_method_that_fails_takes_no_other_with_it(
    folder, estimates, monkeypatch, capsys, failed, error
):
    label = workflow.METHODS[failed].label

    def some(problem, method, progress=None):
        if method.label == label:
            raise error
        return estimates(problem, method)

    monkeypatch.setattr(workflow, "identify", some)
    assert main(["identify", "experiment.toml", "--folds", "0", "-m", ",".join(METHODS)]) == 1
    assert f"{label} failed: " in capsys.readouterr().err
    come_back(folder, estimates, [name for name in METHODS if name != failed])
    assert not (folder / "experiment-results" / failed).exists()


def test_ctrl_c_still_ends_what_judges(folder, estimates, monkeypatch, capsys):
    monkeypatch.setattr(workflow, "identify", estimates)
    monkeypatch.setattr(
        "pivident.judgement.diagnostics.diagnostics.named_causes", failing(KeyboardInterrupt())
    )
    assert main(["identify", "experiment.toml", "--folds", "0"]) == 130
    assert "interrupted" in capsys.readouterr().err
    kept = {".pivident-numbers.json"}
    assert {p.name for p in folder.iterdir()} - kept == {"experiment.toml", "log.csv"}


@pytest.mark.parametrize(
    ("place", "line"),
    [
        ("jackknife", "Standard errors are those of white errors: "),
        ("EquationNoise.of", "No next motion can be designed by this result: "),
    ],
)
def test_what_comes_with_an_estimate_costs_a_warning_of_it(tmp_path, monkeypatch, place, line):
    from tests.planar_simulations import planar_problem

    whole = identify(planar_problem(), "iv-full-rate")
    error = np.linalg.LinAlgError("Singular matrix")
    monkeypatch.setattr(f"{answer.__name__}.{place}", failing(error))
    made = identify(planar_problem(), "iv-full-rate")
    np.testing.assert_array_equal(made.theta, whole.theta)
    assert any(w.message.startswith(line) for w in made.warnings)
    save_identification(made, tmp_path)
    loaded = load_identification(tmp_path)
    expected = whole.formula_std if place == "jackknife" else whole.std
    np.testing.assert_array_equal(loaded.std, expected)
    assert any(w.message.startswith(line) for w in loaded.warnings)


def test_each_line_is_said_once_and_what_is_made_is_returned():
    said = []
    attempts = Attempts(said.append)
    for _ in range(2):
        assert (
            attempts.of("Nothing was drawn", failing(IdentificationError("no ink")), otherwise=3)
            == 3
        )
    assert attempts.of("Nothing was drawn", lambda: 5, otherwise=3) == 5
    assert said == ["Nothing was drawn: no ink."] and len(attempts.errors) == 2
    assert not attempts.unexpected
    attempts.of("Nothing was drawn", failing(ValueError("2 is not 3")))
    assert attempts.unexpected and "unexpected ValueError: 2 is not 3" in said[-1]
    noted = IdentificationError("no ink")
    noted.add_note("buy some")
    assert in_words(noted) == "no ink (buy some)"
    with pytest.raises(BrokenPipeError):
        attempts.of("Nothing was drawn", failing(BrokenPipeError()))
    assert code_of(workflow.Outcome({}, ())) == 0
