"""An estimator of your own on Φ and τ: held-out motion, verdict and report of that estimate."""

from pathlib import Path

import numpy as np

import pivident as pv


def bisquare(phi: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Tukey's bisquare: errors beyond 4.7 robust standard deviations count for nothing."""
    theta = np.linalg.lstsq(phi, tau, rcond=None)[0]
    for _ in range(30):
        error = tau - phi @ theta
        u = error / (4.685 * 1.4826 * np.median(np.abs(error)))
        root = np.where(np.abs(u) < 1.0, 1.0 - u**2, 0.0)
        theta = np.linalg.lstsq(phi * root[:, None], tau * root, rcond=None)[0]
    return np.asarray(theta)


def main(folder: Path) -> tuple[dict[str, pv.Identification], str]:
    """Results of least squares and of the function, and what the verdict says of the latter."""
    robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
    record = pv.simulate(robot, loop, duration=6.0, encoder=1e-6, torque=0.05, seed=2).recording
    tau = record.tau.copy()
    tau[::50] += np.random.default_rng(3).normal(0.0, 60.0, (len(tau[::50]), 2))  # bad samples
    record = pv.Recording.from_arrays(
        record.q, tau, record.rate, joint_names=robot.joint_names, q_ref=record.q_ref
    )
    problem = pv.Problem(robot, (record,), loop)
    results = {"ls": pv.identify(problem, "ls"), "own": pv.identify(problem, bisquare)}
    found = pv.diagnose(problem, results)
    pv.write_report(list(results.values()), folder / "report.html", diagnostics=found)
    return results, str(pv.verdict(found))


if __name__ == "__main__":
    print(main(Path())[1])
