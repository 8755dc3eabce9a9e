"""A control law of your own as a class: it is simulated, and makes the instruments."""

import numpy as np
from numpy.typing import NDArray

import pivident as pv
from pivident.loop import PythonController

Array = NDArray[np.float64]


class SoftIntegrator:
    """PD with an integrator that is held within a bound, which no built-in law has."""

    kp, kd = np.array([6000.0, 2500.0]), np.array([180.0, 60.0])
    ki, bound = np.array([9000.0, 4000.0]), np.array([30.0, 10.0])

    def reset(self) -> None:
        """Before each simulation."""
        self.sum, self.last = np.zeros(2), np.nan * np.zeros(2)

    def __call__(self, k: int, q: Array, q_ref: Array, dq_ref: Array) -> Array:
        """Torque at sample k of 1 kHz."""
        speed, error, self.last = np.nan_to_num(1000.0 * (q - self.last)), q_ref - q, q.copy()
        self.sum = np.clip(self.sum + self.ki * error / 1000.0, -self.bound, self.bound)
        return self.kp * error + self.kd * (dq_ref - speed) + self.sum


def main() -> tuple[pv.Identification, pv.Identification, dict[str, float]]:
    """Least squares, PIV in the loop of this law, and the true values."""
    law = SoftIntegrator()
    near = pv.PD(law.kp, law.kd)  # linear, for the prefilter
    robot, loop = pv.load_robot("planar_2r"), pv.Loop(PythonController(law, law.reset, near))
    record = pv.simulate(robot, loop, duration=6.0, encoder=2e-5, torque=[0.3, 0.1], seed=1)
    problem = pv.Problem(robot, (record.recording,), loop)
    return pv.identify(problem, "ls"), pv.identify(problem, "piv"), record.truth


if __name__ == "__main__":
    print(main()[1])
