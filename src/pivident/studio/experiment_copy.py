"""The copy of an experiment file that a command reads: the same text, and a title for pages."""

from __future__ import annotations

from pivident.errors import ExperimentError
from pivident.init.experiment_text import string_text
from pivident.studio.edits import with_value
from pivident.studio.rows import experiment_rows

#: Where the title of a report stands.
TITLE = ("output", "title")


def with_title(text: str, title: str) -> str:
    """The text with a title for the report, where it has none: that of a hidden copy would be odd.

    Args:
        text: of the experiment file.
        title: name of the project.

    Returns:
        The text; as it is where it cannot be read, which the command then says.
    """
    try:
        if any(row.place == TITLE and row.value is not None for row in experiment_rows(text)):
            return text
        return with_value(text, TITLE, string_text(title.replace("_", " ")))
    except ExperimentError:
        return text
