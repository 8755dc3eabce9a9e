"""The script that lets a shell complete commands, options and files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

if TYPE_CHECKING:
    from cyclopts import App

Shell = Literal["bash", "zsh", "fish"]


def completion_script(app: App, shell: Shell) -> str:
    """The completion script of a command line for a shell."""
    if shell not in get_args(Shell):
        raise ValueError(f"there is no completion for {shell!r}; choose from {get_args(Shell)}")
    return app.generate_completion(prog_name=app.name[0], shell=shell).rstrip()
