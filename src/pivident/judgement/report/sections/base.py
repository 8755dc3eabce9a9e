"""What a section is: a title, a template, and the context that fills it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from pivident.estimation.identification import FittedRecording, Identification
from pivident.estimation.signal_recipes import SignalRecipe
from pivident.foundation.document.plot import Figure
from pivident.judgement.report.report_data import ReportData


@dataclass(frozen=True)
class Gallery:
    """Figures of one method, in a part of the page that can be folded."""

    label: str  # name of the method
    method: int  # index of the method, which is its colour
    opened: bool  # whether it is unfolded at first
    #: title (empty where there is one group only) and figures of each group
    groups: tuple[tuple[str, tuple[Figure, ...]], ...]


class Section(ABC):
    """One part of the page."""

    title: ClassVar[str]  # heading
    anchor: ClassVar[str]  # identifier on the page

    def __init__(self, data: ReportData) -> None:
        self.data = data

    @property
    def template(self) -> str:
        """File in ``templates``, named after the anchor."""
        return f"{self.anchor.replace('-', '_')}.html"

    @property
    def applies(self) -> bool:
        """Whether there is anything to show."""
        return True

    @abstractmethod
    def context(self) -> dict[str, Any]:
        """Values for the template."""

    def opened(self, method: int) -> bool:
        """The last method, by custom the most refined, is unfolded."""
        return method == len(self.data.identifications) - 1

    def gallery(self, method: int, *figures: Figure) -> Gallery:
        """Figures of one method, in one group."""
        return Gallery(self.data.labels[method], method, self.opened(method), (("", figures),))


class SignalSection(Section):
    """A section about signals, which results read from a file do not hold."""

    @property
    def applies(self) -> bool:
        """Only where an identification kept its signals."""
        return any(i.recordings for i in self.data.identifications)


class RecordingSection(SignalSection):
    """A section with figures of every method and recording, as a rule one per joint."""

    @staticmethod
    @abstractmethod
    def draw(
        identification: Identification,
        recording: FittedRecording,
        joint: int,
        method: int,
        points: int,
    ) -> Figure:
        """Signals of one joint, with so many points per trace."""

    def figures(
        self, identification: Identification, recording: FittedRecording, method: int
    ) -> tuple[Figure, ...]:
        """Figures of one recording, at most one per joint."""
        return tuple(
            self.draw(identification, recording, joint, method, self.data.points)
            for joint in range(identification.robot.size)
        )

    def context(self) -> dict[str, Any]:
        """One gallery per method, one group of figures per recording."""
        data = self.data
        galleries = []
        for k, identification in enumerate(data.identifications):
            titled = len(identification.recordings) > 1
            groups = tuple(
                (recording.name if titled else "", self.figures(identification, recording, k))
                for recording in data.drawn(identification.recordings)
            )
            galleries.append(Gallery(data.labels[k], k, self.opened(k), groups))
        return {
            "galleries": galleries,
            "left_out_names": data.left_out,
            "several": data.several,
        }


def signal_recipe(identification: Identification) -> SignalRecipe | None:
    """How positions became derivatives, from the method of the result.

    None for a result loaded from a file: the options of a file are unverified.
    """
    if identification.equations is None or identification.method_used is None:
        return None
    return identification.method_used.signals


def sampling_rate(identification: Identification) -> float:
    """Rate of the recording before any decimation [Hz]; the equations must be there."""
    assert identification.equations is not None
    return float(identification.equations.records[0].kinematics.recording.rate)
