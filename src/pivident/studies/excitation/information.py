"""Information of a motion: what its record will determine, before it is taken.

    I = I₀ + Σ_j A_j,      A_j = Σ_t m_jt (L_j Φ_j)_tᵀ (L_j Φ_j)_t                          (P-23)

with the prefilters L_j of the estimator that will be used, which hold the noise, I₀ of earlier
records, and m = 0 where the estimator leaves samples out because the joint stands still. The motion
is sampled at a rate of its own, below that of the record: prefilters act by their frequency
response, and each sample counts for as many rows as the record will have. How the A_j add up is up
to the question, see `questions`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.solved_equations import EquationNoise
from pivident.loop.motion.motion import SpeedLimits
from pivident.signals.prefilter import Prefilter
from pivident.studies.excitation.questions import Question

#: Position, speed and acceleration, each (samples, joints).
Samples = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Information:
    """Information of motions that are sampled alike.

    Attributes:
        regressor: the observation matrix.
        noise: noise of the equations.
        rate: of the samples [Hz].
        earlier: I₀, shape (unknowns, unknowns).
        question: what is asked.
        rounds: how often the motion is run.
    """

    regressor: Regressor
    noise: EquationNoise
    rate: float
    earlier: np.ndarray
    question: Question
    rounds: int = 1

    def of(self, motion: Samples) -> np.ndarray:
        """I of a motion, shape (unknowns, unknowns).

        Args:
            motion: q, dq, ddq, each (samples, joints).
        """
        return self.with_rows(motion)[0]

    def with_rows(self, motion: Samples) -> tuple[np.ndarray, list[np.ndarray]]:
        """I of a motion, and the filtered rows of each joint, shape (columns, samples).

        Args:
            motion: q, dq, ddq, each (samples, joints).
        """
        q, dq, ddq = (np.ascontiguousarray(x.T) for x in motion)
        packed = self.regressor.packed(q, dq, ddq, inner=self.regressor.levels(dq))
        used = self.used(dq)
        size = len(self.regressor.parameters)
        by_joint, rows = [], []
        for j in range(self.regressor.robot.size):
            own = slice(self.regressor.offsets[j], self.regressor.offsets[j + 1])
            filtered = self._filtered(j, packed[own], adjoint=False) * used[j]
            columns = self.regressor.columns_of(j)
            information = np.zeros((size, size))
            information[np.ix_(columns, columns)] = filtered @ filtered.T
            by_joint.append(information)
            rows.append(filtered)
        return self.earlier + self.question.information(by_joint), rows

    def row_weights(self, motion: Samples, rows: list[np.ndarray], slope: np.ndarray) -> np.ndarray:
        """∂J/∂Φ of a criterion J with the symmetric slope ∂J/∂I, (samples, joints, parameters).

            dJ = Σ_j tr(∂J/∂A_j dA_j),    ∂J/∂Φ_j = 2 L_jᵀ m (L_j Φ_j) ∂J/∂A_j

        Args:
            motion: q, dq, ddq, each (samples, joints).
            rows: filtered rows of each joint, see `with_rows`.
            slope: ∂J/∂I, shape (unknowns, unknowns).
        """
        used = self.used(motion[1].T)
        samples, joints = motion[0].shape
        out = np.zeros((samples, joints, len(self.regressor.parameters)))
        for j in range(joints):
            columns = self.regressor.columns_of(j)
            own = self.question.slope_of(j, slope)[np.ix_(columns, columns)]
            back = 2.0 * own @ rows[j] * used[j]
            out[:, j, columns] = self._filtered(j, back, adjoint=True).T
        return out

    def used(self, dq: np.ndarray) -> np.ndarray:
        """Samples that the estimator will use, shape (joints, samples), for speeds like it."""
        couplings = self.regressor.robot.couplings
        return SpeedLimits(self.noise.standstill, couplings).moving(dq).astype(float)

    def _filtered(self, joint: int, rows: np.ndarray, *, adjoint: bool) -> np.ndarray:
        """L_j of rows (columns, samples), or its adjoint; each sample counts for its rows."""
        prefilter = self.noise.filters[joint]
        counts = np.sqrt(self.rounds * self.noise.rate / self.rate)
        if prefilter.begins_anew and len(prefilter.fir) == 1:
            return rows * (counts / np.sqrt(prefilter.variance))
        samples = rows.shape[1]
        response = prefilter.response(np.fft.rfftfreq(samples, 1.0 / self.rate), self.noise.rate)
        if adjoint:
            response = response.conj()
        # at the Nyquist frequency a real signal has a real spectrum
        if samples % 2 == 0:
            response[-1] = response[-1].real
        return counts * np.fft.irfft(np.fft.rfft(rows, axis=1) * response, samples, axis=1)


def assumed_noise(deviation: np.ndarray, rate: float) -> EquationNoise:
    """White noise of the torque where no earlier result gives it.

    Args:
        deviation: standard deviation of a row, shape (joints,) [N m or N].
        rate: independent rows per second [Hz].
    """
    filters = tuple(Prefilter(variance=float(d) ** 2) for d in deviation)
    return EquationNoise(rate, np.zeros(len(filters)), filters)
