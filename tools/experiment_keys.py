"""Write what docs/experiment_file.md says about each key, for the pages that show it beside them.

python -m tools.experiment_keys
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from tests.test_docs import TABLES, models_of, sections

FILE = Path(__file__).resolve().parents[1] / "src/pivident/studio/experiment_keys.json"

_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")


def documented() -> dict[str, dict[str, dict[str, str]]]:
    """Type, default, unit and meaning of each key, by the class of its table in the schema."""
    found = {}
    for heading, rows in sections().items():
        if heading not in TABLES:
            continue
        for model in models_of(TABLES[heading][0]):
            own = {field.alias or name for name, field in model.model_fields.items()}
            found[model.__name__] = {
                key: {
                    "type": kind,
                    "default": default,
                    "unit": "" if unit == "–" else unit,
                    "meaning": _LINK.sub(r"\1", meaning),
                }
                for key, kind, default, unit, meaning in (
                    [row[0].strip("`"), *row[1:4], " | ".join(row[4:])] for row in rows
                )
                if key in own
            }
    return found


def written() -> str:
    """The text of the file."""
    return json.dumps(documented(), ensure_ascii=False, indent=1, sort_keys=True) + "\n"


if __name__ == "__main__":
    FILE.write_text(written(), encoding="utf-8")
