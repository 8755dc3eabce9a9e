"""Diagnostics of a result in axes of one's own: pivident's figures beside a plot of one's own."""

from matplotlib.figure import Figure

import pivident as pv


def diagnostics(problem: pv.Problem, method: str = "piv", folds: int = 5) -> Figure:
    """Spectrum and autocorrelation of each joint's residual, and its held-out torque error."""
    result = pv.identify(problem, method)
    held_out = pv.cross_validate(problem, method, folds=folds, identification=result)
    joints = problem.robot.joint_names

    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    spectra, correlations, errors = figure.subfigures(3, 1, squeeze=False)[:, 0]
    pv.figures.figure_of_residual_spectra(result, ax=spectra.subplots(1, len(joints)))
    pv.figures.figure_of_autocorrelations(result, ax=correlations.subplots(1, len(joints)))
    axes = errors.subplots()
    axes.bar(joints, held_out.prediction.relative)
    axes.set(ylabel="held-out torque error [%]", title=f"{result.method}, {folds} blocks")
    return figure


if __name__ == "__main__":
    robot = pv.load_robot("planar_2r")
    loop = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]))
    made = pv.simulate(robot, loop, encoder=5e-6, torque=0.05)
    diagnostics(pv.Problem(robot, (made.recording,), loop)).savefig("diagnostics.png")
