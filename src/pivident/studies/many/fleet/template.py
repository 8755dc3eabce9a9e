"""The experiment file of a fleet: one template for all logs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pivident.estimation.method import Method
from pivident.estimation.methods import WITHOUT_TORQUE
from pivident.experiment.experiment import Experiment
from pivident.experiment.explained import checked, errors_name, plain_form, toml_content
from pivident.experiment.missing_torque import is_without_torque, with_columns
from pivident.robot.naming import ROBOT_FILES
from pivident.studies.many.fleet.fleet_keys import FleetEntry, FleetFile, as_template
from pivident.studies.many.fleet.logs import FleetLog

#: Default name of the template in the folder of logs.
FILE = "fleet.toml"

#: Tables and keys that no estimate depends on: they may change from one call to the next.
OF_THE_JUDGEMENT = {
    "fleet": {"watch", "baseline", "baseline_records", "level", "planned_records", "time"},
    "output": True,
    "validation": True,
    "gains": True,
}


@dataclass(frozen=True, eq=False)
class Template:
    """The experiment file that all logs of a fleet share."""

    path: Path  # the file
    content: FleetFile  # its tables

    @property
    def fleet(self) -> FleetEntry:
        """The table ``[fleet]``."""
        return self.content.fleet

    @property
    def pattern(self) -> str | Mapping[str, str]:
        """Pattern of the logs."""
        files = self.content.recording[0].files
        assert files is not None, "as_template has put one in"
        return files

    @cached_property
    def experiment(self) -> Experiment:
        """The tables as an experiment without records."""
        return Experiment(self.path, self.content)

    @property
    def method_name(self) -> str:
        """Short name of the method: that of the table, ``piv`` with a controller, else ``ls``.

        Of logs without torque that of `WITHOUT_TORQUE`.
        """
        named = self.content.identify.methods
        if self.fleet.method is None and named and len(named) == 1:
            return named[0]
        if self.fleet.method is None and is_without_torque(self.content):
            return WITHOUT_TORQUE[0]
        return self.fleet.method or ("ls" if self.content.controller is None else "piv")

    @cached_property
    def method(self) -> Method:
        """The method with the options of the file."""
        return self.experiment.methods([self.method_name])[self.method_name]

    def experiment_of(self, log: FleetLog) -> Experiment:
        """The experiment of one log."""
        (entry,) = self.content.recording
        entry = with_columns(entry, temperature=self.fleet.temperature)
        entries = []
        for record in log.records:
            files = {key: str(Path(path).absolute()) for key, path in record}
            given = files if isinstance(entry.files, dict) else next(iter(files.values()))
            entries.append(entry.model_copy(update={"files": given}))
        made = Experiment(self.path, self.content.model_copy(update={"recording": entries}))
        vars(made)["robot"] = self.experiment.robot  # read once; its file need not be here
        return made

    def with_level(self, level: float) -> Template:
        """The same with another level of false alarm."""
        fleet = self.fleet.model_copy(update={"level": level})
        return Template(self.path, self.content.model_copy(update={"fleet": fleet}))

    @cached_property
    def identity(self) -> dict[str, Any]:
        """All that the numbers of a log depend on, as plain values."""
        content = self.content.model_dump(
            mode="json",
            exclude_unset=True,
            exclude=OF_THE_JUDGEMENT,  # type: ignore[arg-type]
            by_alias=True,
            warnings=False,  # a whole number for a real one is no reason to warn
        )
        model = self.content.robot.model
        self.experiment.robot  # noqa: B018 - says what is wrong with the robot
        if model.endswith(ROBOT_FILES):
            file = self.path.parent / model
            content["robot_sha256"] = hashlib.sha256(file.read_bytes()).hexdigest()
        return content | {"method": self.method_name}

    @property
    def hash(self) -> str:
        """SHA-256 of the identity."""
        text = json.dumps(self.identity, sort_keys=True, separators=(",", ":"), default=str)
        return hashlib.sha256(text.encode()).hexdigest()


def load_template(path: str | Path) -> Template:
    """Read and check the experiment file of a fleet; no log is read yet."""
    path = Path(path)
    with errors_name(path, ""):
        template = Template(path, checked(as_template(plain_form(toml_content(path))), FleetFile))
    template.method, template.experiment.robot  # noqa: B018 - making them checks
    return template
