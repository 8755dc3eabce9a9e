"""Progress of a command for the program that started it: JSON, a line each, at the end of a file.

The environment variable ``PIVIDENT_PROGRESS`` names the file:

    {"stages": {"ls": 3.1, "piv": 14.0}}                    what will be done, expected seconds
    {"stage": "piv", "number": 2, "of": 4, "left_s": 15.2}  a stage begins
    {"say": "PIV: iteration 3 …", "number": 2, "of": 4, "left_s": 9.7}
    {"keep": "IDIM-PIV: 6 iterations …"}                    what has been done
"""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Any

from pivident.text.plain_values import plain, strict_json

#: The environment variable that names the file.
ENVIRONMENT = "PIVIDENT_PROGRESS"


class ProgressChannel:
    """Appends to the file that the environment names; without one, nothing is written.

    Progress is a courtesy: a file that cannot be written, on a full disk for instance, does not end
    the work.
    """

    def __init__(self) -> None:
        self._path = os.environ.get(ENVIRONMENT, "")

    def write(self, **entry: Any) -> None:
        """Append one line, whole or not at all.

        Args:
            entry: plain values by name.
        """
        if self._path:
            line = f"{strict_json(plain(entry))}\n".encode(errors="backslashreplace")
            with suppress(OSError), open(self._path, "ab", buffering=0) as file:
                file.write(line)
