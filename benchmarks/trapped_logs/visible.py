"""By what each trap can be seen on each log, and which traps a log cannot have."""

from __future__ import annotations

#: Traps that a log cannot have, and why.
INAPPLICABLE = {
    "EMPS": {
        "torques exchanged": "it has one joint",
        "zero 90 deg off": "it slides, and nothing depends on its position",
        "degrees as rad": "it slides",
    },
}

#: Evidence by log and trap.
VISIBLE: dict[str, dict[str, str]] = {}
