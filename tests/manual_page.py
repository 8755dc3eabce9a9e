"""Tables of docs/experiment_file.md from the schema: ``python -m tests.manual_page``."""

from __future__ import annotations

import re
from pathlib import Path

from pivident.experiment import consistency_keys, excite_keys, file_keys, identify_table
from pivident.experiment.manual import rows_of
from pivident.robot.mdh_keys import Entry, FrictionEntry

PAGE = Path(__file__).parents[1] / "docs" / "experiment_file.md"

#: Schema of the table below each heading.
TABLES: dict[str, type[Entry]] = {
    "Tables": file_keys.ExperimentFile,
    "`[robot]`": file_keys.RobotEntry,
    "friction terms": FrictionEntry,
    "couplings": file_keys.CouplingEntry,
    "bodies": file_keys.BodyEntry,
    "`[[wrench]]`": file_keys.WrenchEntry,
    "`[[contact]]`": file_keys.ContactEntry,
    "`[recording]`": file_keys.RecordingEntry,
    "columns": file_keys.ColumnsEntry,
    "units": file_keys.UnitsEntry,
    "`[controller]`": file_keys.ControllerEntry,
    "`[identify]`": identify_table.IdentifyEntry,
    "constraints": identify_table.ConstraintEntry,
    **identify_table.METHOD_ENTRIES,
    **identify_table.PARTS,
    "`[validation]`": file_keys.ValidationEntry,
    "`[output]`": file_keys.OutputEntry,
    "`[gains]`": file_keys.GainsEntry,
    "payload": file_keys.PayloadEntry,
    "`[consistency]`": consistency_keys.ConsistencyEntry,
    "bounds": consistency_keys.LinkBoundsEntry,
    "`[payload]`": file_keys.LoadEntry,
    "frame": file_keys.ToolFrameEntry,
    "`[excite]`": excite_keys.ExciteEntry,
    "joint limits": excite_keys.JointLimitEntry,
    "load": excite_keys.LoadBodyEntry,
    "body": excite_keys.BodyEntry,
    "obstacle": excite_keys.ObstacleEntry,
    "tool_box": excite_keys.ToolBoxEntry,
}

#: Lines of a table.
_TABLE = re.compile(r"(?:^\|[^\n]*\n)+", re.MULTILINE)


def sections(text: str) -> list[str]:
    """The text cut in front of its headings of the second and third order."""
    return re.split(r"^(?=#{2,3} )", text, flags=re.MULTILINE)


def heading_of(section: str) -> str:
    """Heading of a section, without its marks."""
    return section.partition("\n")[0].lstrip("# ")


def page(text: str) -> str:
    """The page with the table of each section made from its schema."""
    made = []
    for section in sections(text):
        model = TABLES.get(heading_of(section))
        if model is not None:
            table = "\n".join(rows_of(model)) + "\n"
            section = _TABLE.sub(lambda _, table=table: table, section, count=1)
        made.append(section)
    return "".join(made)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text("utf-8")), encoding="utf-8")
