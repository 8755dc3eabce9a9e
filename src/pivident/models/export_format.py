"""What a format must offer so that models are exported in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pivident.models.exported import ExportedText, Verification
    from pivident.models.runnable_model import RunnableModel


@dataclass(frozen=True)
class FileOptions:
    """What some formats need besides the model."""

    name: str = "robot_model"  # of the file; prefix of the functions of a C file
    original: bytes | None = None  # URDF whose inertials are replaced; None: a new one
    #: Positions of the other joints of that file [rad or m], by name.
    frozen: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes:
        title: its name in a sentence.
        ending: of the names of its files, such as ``.urdf``.
        write: the model as a file, with what the format cannot represent.
        checks: each loads the file with another program and compares torques with the model's.
        not_loaded: why there are no checks.
        holds_base: whether it describes a robot on a base that moves.
        shows_intervals: whether it shows intervals of confidence, which are computed for it.
    """

    title: str
    ending: str
    write: Callable[[RunnableModel, FileOptions], ExportedText]
    checks: tuple[Callable[[Any, RunnableModel, FileOptions], Verification], ...] = ()
    not_loaded: str = ""
    holds_base: bool = False
    shows_intervals: bool = False
