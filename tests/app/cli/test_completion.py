"""``pivident completion``: a script for each shell that knows commands and options."""

import shutil
import subprocess

import pytest

from pivident.app.cli import main
from pivident.app.cli.app import app


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_script_names_all_commands(shell, capsys):
    assert main(["completion", shell]) == 0
    text = capsys.readouterr().out
    for name in app:
        if not name.startswith("-"):
            assert name in text, name
    assert "folds" in text and "scheduler" in text


def test_bash_completes_a_command_and_an_option(tmp_path, capsys):
    if shutil.which("bash") is None:
        pytest.skip("there is no bash")
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "pivident.bash"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    asked = (
        f"source {script}; COMP_WORDS=(pivident ide); COMP_CWORD=1; _pivident; "
        'echo "${COMPREPLY[@]}"; COMP_WORDS=(pivident identify --fo); COMP_CWORD=2; _pivident; '
        'echo "${COMPREPLY[@]}"'
    )
    said = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["identify", "--folds"]


def test_another_shell_is_refused(capsys):
    assert main(["completion", "csh"]) == 2
    assert 'Choose from: "bash", "zsh", "fish"' in capsys.readouterr().err
