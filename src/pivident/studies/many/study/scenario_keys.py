"""Keys of a scenario file, their types and defaults, and contradictions between them.

Robot, control law and methods have the tables of an experiment file; instead of a record, a
scenario describes its simulation. This module needs pydantic and is imported only when a scenario
is read.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from pivident.data.recording.recording import TorqueTiming
from pivident.experiment.file_keys import ControllerEntry, RobotEntry
from pivident.experiment.identify_table import IdentifyEntry
from pivident.experiment.table_values import Numbers
from pivident.foundation.errors import UnusableValue
from pivident.robot.mdh_keys import Entry

#: Keys that only one kind of trajectory has.
OF_KIND = {
    "point_to_point": {"reach", "speed", "dwell"},
    "trapezoidal": {"reach", "speed", "acceleration", "dwell"},
    "fourier": {"harmonics", "frequency", "speed", "acceleration", "optimise"},
}

Share = Annotated[float, Field(gt=0, le=1)]
Seed = Annotated[int, Field(ge=0)]


class TruthEntry(Entry):
    """The true parameters: nominal values of the robot, unless values say otherwise."""

    parameters: Annotated[list[str], Field(min_length=1)] | None = None
    values: dict[str, float] = Field(default_factory=dict)


class StartEntry(Entry):
    """Where the iteration starts, relative to the truth."""

    inertia: float = 1.1
    friction: float = 0.0
    spread: Annotated[float, Field(ge=0, lt=1)] = 0.0
    count: PositiveInt = 1

    @model_validator(mode="after")
    def _spread_needs_starts(self) -> StartEntry:
        if self.count > 1 and self.spread == 0.0:
            raise UnusableValue(
                f"count = {self.count} starts without a spread are identical",
                advice="give spread = 0.15",
            )
        return self


class RecordEntry(Entry):
    """How the loop is sampled and recorded."""

    rate: PositiveFloat = 5000.0
    control_rate: PositiveFloat | None = None
    torque_timing: TorqueTiming = "held"
    records: PositiveInt | None = None

    @model_validator(mode="after")
    def _whole_ratio(self) -> RecordEntry:
        ratio = self.law_rate / self.rate
        if abs(ratio - round(ratio)) > 1e-9 or ratio < 1:
            raise ValueError(
                f"control_rate = {self.law_rate:g} must be a whole multiple of rate = {self.rate:g}"
            )
        if self.torque_timing == "averaged":
            raise UnusableValue(
                'torque_timing = "averaged" cannot be simulated', advice='use "held" or "sampled"'
            )
        return self

    @property
    def law_rate(self) -> float:
        """Rate of the control law [Hz]."""
        return self.control_rate or self.rate

    @property
    def step(self) -> int:
        """Control periods per sample of the record."""
        return round(self.law_rate / self.rate)


class TrajectoryEntry(Entry):
    """The reference motion."""

    type: Literal["point_to_point", "trapezoidal", "fourier"] = "point_to_point"
    duration: PositiveFloat = 6.9
    seed: Seed | Annotated[list[Seed], Field(min_length=1)] = 0
    speed: Share = 0.8
    reach: Numbers | None = None
    dwell: NonNegativeFloat = 0.05
    harmonics: PositiveInt = 5
    frequency: PositiveFloat = 0.1
    acceleration: PositiveFloat | None = None
    optimise: bool = True

    @model_validator(mode="after")
    def _keys_belong_to_type(self) -> TrajectoryEntry:
        others = set().union(*OF_KIND.values()) - OF_KIND[self.type]
        foreign = sorted(self.model_fields_set & others)
        if foreign:
            raise UnusableValue(
                f"a {self.type} trajectory has no {', '.join(foreign)}",
                advice=f"its keys are duration, seed, {', '.join(sorted(OF_KIND[self.type]))}",
            )
        if self.type == "fourier" and isinstance(self.seed, list):
            raise UnusableValue(
                "several seeds need several motions, and a fourier trajectory is optimised once",
                advice="give one seed, or a table [vary]",
            )
        if self.type == "trapezoidal" and self.acceleration is None:
            raise UnusableValue(
                "a trapezoidal trajectory needs its largest acceleration",
                advice="give acceleration = 10",
            )
        return self

    @property
    def seeds(self) -> list[int]:
        """One seed for each motion."""
        return self.seed if isinstance(self.seed, list) else [self.seed]


class ColouredEntry(Entry):
    """Position noise with a peak in its spectrum, AR(2)."""

    std: Numbers
    frequency: PositiveFloat
    radius: Annotated[float, Field(ge=0, lt=1)] = 0.998


class NoiseEntry(Entry):
    """Noise of encoders and torque sensors."""

    encoder: Numbers = 0.0
    torque: Numbers = 0.0
    coloured: ColouredEntry | None = None
    counts: Numbers = 0.0
    where: Literal["loop", "record"] = "loop"
    rounding: Literal["record", "loop"] = "record"

    @model_validator(mode="after")
    def _some_noise(self) -> NoiseEntry:
        for key in ("encoder", "torque", "counts"):
            value = getattr(self, key)
            if min(value) < 0 if isinstance(value, list) else value < 0:
                what = "a number of counts" if key == "counts" else "a standard deviation"
                raise ValueError(f"{key} = {value} is {what} and cannot be negative")
        if "rounding" in self.model_fields_set and not _positive(self.counts):
            raise UnusableValue(
                "rounding is given, but no counts to round to", advice="add counts or remove it"
            )
        if not (self.coloured or any(map(_positive, (self.counts, self.encoder, self.torque)))):
            raise UnusableValue(
                "there is no noise, so all runs would be identical",
                advice="give encoder, torque, coloured or counts",
            )
        return self


def _positive(value: float | list[float]) -> bool:
    return max(value) > 0 if isinstance(value, list) else value > 0


class ScenarioFile(Entry):
    """The whole file, its short forms written out."""

    description: str = ""
    runs: Annotated[int, Field(gt=0, le=10_000_000)] = 100
    seed: Seed = 0
    robot: RobotEntry
    truth: TruthEntry = TruthEntry()
    start: StartEntry = StartEntry()
    controller: ControllerEntry
    record: RecordEntry = RecordEntry()
    trajectory: TrajectoryEntry = TrajectoryEntry()
    validation: TrajectoryEntry | None = None
    noise: NoiseEntry
    law: Literal["known", "identified"] = "known"
    identify: IdentifyEntry = Field(default_factory=lambda: IdentifyEntry.model_validate({}))
    vary: dict[str, dict[str, dict[str, Any]]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _consistent(self) -> ScenarioFile:
        if self.controller.type not in ("pd", "pid", "cascade"):
            raise UnusableValue(
                f'controller.type = "{self.controller.type}" cannot be simulated',
                advice="use pd, pid or cascade with its gains",
            )
        if self.controller.source != "recorded":
            raise UnusableValue(
                "controller.reference is always the recorded one in a scenario",
                advice="remove the key",
            )
        if self.identify.initial:
            raise UnusableValue(
                "identify.initial contradicts the table [start]", advice="keep that one"
            )
        if self.noise.coloured and self.noise.coloured.frequency >= self.record.law_rate / 2:
            raise ValueError(
                f"noise.coloured.frequency = {self.noise.coloured.frequency:g} Hz is not below "
                f"half the control rate of {self.record.law_rate:g} Hz"
            )
        if self.record.records is not None:
            different = self.record.records * self.start.count
            if self.runs > different:
                raise UnusableValue(
                    f"{self.runs} runs on {self.record.records} records from {self.start.count} "
                    f"start(s) would repeat themselves after {different}",
                    advice="lower runs, raise record.records, or give start.count and start.spread",
                )
        return self
