"""How near simulated positions come to measured ones on motion that was not fitted.

    rms(q_s - q) of each joint

A closed loop is given reference and law, an open one the recorded torques and, at the first sample
of each stretch, the smoothed position and speed. Loop parameters that were identified with the
model have their estimated values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.methods import OutputError
from pivident.estimation.output_error.record_stretches import open_stretches
from pivident.estimation.problem import Problem, position_units
from pivident.motion.kinematics import Kinematics
from pivident.validation.held_out.fitted_loop import (
    encoder_offsets,
    motion_of,
    with_loop_parameters,
)
from pivident.validation.held_out.prediction import Judge
from pivident.validation.held_out.replay import ReplayError


@dataclass(frozen=True, eq=False)
class SimulationError:
    """Errors of simulated positions over some samples."""

    loop: str  # closed or open
    joint_names: tuple[str, ...]  # names of the joints
    units: tuple[str, ...]  # rad or m
    position: np.ndarray  # rms of simulated minus measured positions, shape (joints,) [rad or m]
    samples: int  # number of samples

    @classmethod
    def of(cls, replay: ReplayError) -> SimulationError:
        """Those of a replayed closed loop."""
        return cls(
            "closed", replay.joint_names, replay.position_units, replay.position, replay.samples
        )


class OpenLoop:
    """Stretches of one recording, driven by its torques, with any estimate of a problem."""

    def __init__(self, problem: Problem, judge: Judge) -> None:
        self.problem, self.judge = problem, judge

    def score(self, found: Identification, spans: Sequence[slice]) -> list[SimulationError]:
        """Errors of an estimate on stretches of the recording.

        Raises:
            SimulationDiverged: a stretch leaves what was measured altogether.
            MassMatrixNotPositiveDefinite: the estimate is that of no machine.
        """
        return [self._error(found, span) for span in spans]

    def _error(self, found: Identification, span: slice) -> SimulationError:
        recording, smooth = self.judge.recording, self.judge.kinematics
        start, stop, _ = span.indices(recording.samples)
        part = recording.part(start, stop)
        cut: Kinematics = replace(smooth, q=smooth.q[:, start:stop], dq=smooth.dq[:, start:stop])
        problem = replace(self.problem, recordings=(part,))
        method = found.method_used
        longest = method.segment if isinstance(method, OutputError) else None
        squares, samples = np.zeros(recording.joints), 0
        for stretch in open_stretches(problem, found.parameters, found.theta, [cut], longest):
            loop = with_loop_parameters(problem, stretch.loop, found)
            own = (motion_of(loop).q + encoder_offsets(loop))[:: stretch.step][: stretch.samples]
            squares += np.sum((own - stretch.q[: len(own)]) ** 2, axis=0)
            samples += len(own)
        return SimulationError(
            "open", recording.joint_names, tuple(position_units(problem)),
            np.sqrt(squares / samples), samples,
        )  # fmt: skip


def pooled_simulation(errors: Sequence[SimulationError]) -> SimulationError:
    """One error of several stretches: squares are averaged over all samples."""
    weights = [e.samples for e in errors]
    mean = np.sqrt(np.average([e.position**2 for e in errors], axis=0, weights=weights))
    return replace(errors[0], position=mean, samples=sum(weights))
