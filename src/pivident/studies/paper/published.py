"""What Brunot, Janot, Young and Carrillo (2018) state: Table 1, and figures of the text.

M. Brunot, A. Janot, P. C. Young, F. Carrillo, An improved instrumental variable method for
industrial robot model identification, Control Engineering Practice 74 (2018) 107-117, Table 1:
estimates of 28 parameters of a Stäubli TX40 and their relative standard deviations. Figures of the
text are in ``stated.toml``, with their sections.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources

from pivident.foundation.text.display import Displayed
from pivident.foundation.text.toml import parse_toml

#: Columns of the table by the key of its file.
COLUMNS = {
    "ls": "IDIM-LS",
    "iv": "IDIM-IV",
    "piv": "IDIM-PIV",
    "piv_identified_controller": "IDIM-PIV, law identified",
}


@dataclass(frozen=True)
class PublishedParameter(Displayed):
    """One row of the table; both dictionaries are by the keys of ``COLUMNS``.

    Attributes:
        name: base parameter, as in results.
        value: estimates [SI unit of the parameter].
        relative_std: relative standard deviations [%].
    """

    name: str
    value: dict[str, float]
    relative_std: dict[str, float]


@cache
def published_table() -> tuple[PublishedParameter, ...]:
    """The 28 rows of Table 1, in its order."""
    text = (resources.files(__package__) / "table1.csv").read_text("utf-8")
    return tuple(
        PublishedParameter(
            row["parameter"],
            {key: float(row[key]) for key in COLUMNS},
            {key: float(row[f"{key}_relative_std_percent"]) for key in COLUMNS},
        )
        for row in csv.DictReader(text.splitlines())
    )


@cache
def stated() -> dict[str, int]:
    """Figures of the text by name, see ``stated.toml`` for units and sections."""
    text = (resources.files(__package__) / "stated.toml").read_text("utf-8")
    return {name: int(value) for name, value in parse_toml(text).items()}
