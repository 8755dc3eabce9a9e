"""Keys of the table ``[excite]``: what a designed motion must keep to, and what is asked of it.

All in SI units on the joint side: rad and m, rad/s and m/s, N m and N. This module needs pydantic
and is imported only when a file is read.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PositiveFloat, model_validator

from pivident.experiment.room_keys import RoomEntry
from pivident.robot.mdh_schema import Entry, Vector3, Vector6

Share = Annotated[float, Field(gt=0.0, le=1.0)]


class JointLimitEntry(Entry):
    """Limits of one joint in place of those of its description."""

    position: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    speed: PositiveFloat | None = None
    acceleration: PositiveFloat | None = None
    jerk: PositiveFloat | None = None
    torque: PositiveFloat | None = None
    rms_torque: PositiveFloat | None = None


class LoadBodyEntry(Entry):
    """A body at the last link, which a payload or drive gains are identified with."""

    mass: PositiveFloat
    center_of_mass: Vector3 = Field([0.0, 0.0, 0.05])
    inertia: Vector6 | None = None


class ExciteEntry(RoomEntry):
    """What a designed motion must keep to, and what is asked of it."""

    duration: PositiveFloat | None = None
    motion: Literal["fourier", "splines", "postures"] | None = None
    criterion: Literal["d", "a", "worst", "cond"] | None = None
    parameters: list[str] = Field(default_factory=list)
    to: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    start: list[float] | None = None
    seconds: PositiveFloat | None = None
    seed: Annotated[int, Field(ge=0)] | None = None
    rate: PositiveFloat | None = None
    speed: Share = 1.0
    torque: Share = 1.0
    acceleration: PositiveFloat | list[PositiveFloat] | None = None
    jerk: PositiveFloat | list[PositiveFloat] | None = None
    torque_noise: PositiveFloat | list[PositiveFloat] | None = None
    joint: dict[str, JointLimitEntry] = Field(default_factory=dict)
    about: Literal["robot", "load", "gains"] = "robot"
    load: LoadBodyEntry | None = None

    @model_validator(mode="after")
    def _load_belongs_to_its_question(self) -> ExciteEntry:
        if self.about != "robot" and self.load is None:
            raise ValueError(
                f"about = {self.about!r} needs the body that the second run is taken with: add "
                "[excite.load] with mass = … (kg) and center_of_mass = [x, y, z] (m, in the frame "
                "of the last link)"
            )
        return self
