"""The copy of an experiment file that a command reads: the same text, and a title for pages."""

from __future__ import annotations

import tomllib

#: Where the title of a report stands.
TABLE, KEY = "output", "title"


def with_title(text: str, title: str) -> str:
    """The text with a title for the report, where it has none: that of a hidden copy would be odd.

    Args:
        text: of the experiment file.
        title: name of the project.

    Returns:
        The text; as it is where it cannot be read, which the command then says.
    """
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        if KEY in tomllib.loads(text).get(TABLE, {}):
            return text
        document = tomlkit.parse(text)
        document.setdefault(TABLE, tomlkit.table())[KEY] = title.replace("_", " ")
        changed = tomlkit.dumps(document)
        tomllib.loads(changed)
    except (TOMLKitError, tomllib.TOMLDecodeError, TypeError, ValueError, RecursionError):
        return text
    return changed
