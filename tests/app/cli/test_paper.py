"""``pivident paper`` from the command line: its options, and errors in one line."""

import os

import pytest

from pivident.app.cli.app import main
from pivident.app.cli.console import INTERRUPTED, WRONG_INPUT, WRONG_USAGE
from pivident.studies.paper import page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--runs", "0"], "--runs is 0; at least 1 is needed"),
        (["--workers", "-1"], "--workers is -1; at least 1 is needed"),
    ],
)
def test_counts_below_one_are_refused(arguments, said, capsys):
    assert main(["paper", *arguments]) == WRONG_INPUT
    assert said in capsys.readouterr().err


def test_an_unknown_option_is_wrong_usage(capsys):
    assert main(["paper", "--quickly"]) == WRONG_USAGE
    assert "--quickly" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(tmp_path, capsys):
    (tmp_path / "taken").write_text("a file")
    assert main(["paper", "--quick", "--out", str(tmp_path / "taken")]) == WRONG_INPUT
    assert "taken is a file; choose another --out" in capsys.readouterr().err


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_refused(tmp_path, capsys):
    (tmp_path / "locked").mkdir(mode=0o500)
    assert main(["paper", "--quick", "--out", str(tmp_path / "locked" / "page")]) == WRONG_INPUT
    assert "no permission" in capsys.readouterr().err


def test_a_study_of_another_scenario_is_refused(tmp_path, capsys):
    from pivident.studies.many.study.run import Store
    from pivident.studies.paper.experiment import condition

    other = condition("motor")
    with Store(tmp_path / "study" / "joint-known").opened(other, 1):
        pass
    assert main(["paper", "--quick", "--out", str(tmp_path)]) == WRONG_INPUT
    assert "it contains runs of another scenario" in capsys.readouterr().err
    assert not (tmp_path / "paper.html").exists()


def test_an_interruption_says_where_the_runs_are(tmp_path, capsys, monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(page, "run_study", interrupted)
    assert main(["paper", "--out", str(tmp_path / "page")]) == INTERRUPTED
    said = capsys.readouterr().err
    assert f"the finished runs are in {tmp_path / 'page' / 'study'}" in said
    assert not (tmp_path / "page" / "paper.html").exists()


def test_an_option_that_is_missing_is_said_to_be_missing(capsys):
    assert main(["export", "results", "--to", "urdf"]) == WRONG_USAGE
    assert "--out is missing" in capsys.readouterr().err
    assert main(["export", "results", "--to", "urdf", "--out"]) == WRONG_USAGE
    assert "requires an argument" in capsys.readouterr().err
