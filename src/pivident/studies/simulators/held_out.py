"""The error of a simulator, before and after, on motion that the fit has not seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.estimation.auxiliary_model import loop_signals
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import format_significant
from pivident.loop.simulation.control_loop import Loop, with_measured_gravity
from pivident.robot.description import Robot
from pivident.robot.mjcf_model import read_spec
from pivident.robot.naming import URDF_FILES
from pivident.signals.random_walk import smooth_channels
from pivident.studies.simulators.fit_simulator import fitted_controller, in_whole_periods
from pivident.studies.simulators.mujoco_replay import Replay, fine_settings, held_spec, replay
from pivident.studies.simulators.simulator_fit import SimulatorFit

#: Factor of the error that is worse, and not only another error of the same size.
WORSE = 1.1


@dataclass(frozen=True, eq=False)
class HeldOut(Displayed):
    """Positions that MuJoCo gives beside those that were measured.

    Attributes:
        name: of the motion.
        robot: whose joints they are.
        t: time of each sample [s], shape (samples,).
        q: measured positions, shape (samples, joints) [rad or m].
        before: simulated with the description as it came, likewise; NaN where it diverged.
        after: simulated with the fitted file, delay and bias, shape (samples, joints) [rad or m].
        before_own: as ``before`` by the file's own step, integrator and friction, likewise.
        as_written: as ``after`` by those, shape (samples, joints) [rad or m].
        file_step: time step of the file [s].
        first: first sample that counts.
    """

    name: str
    robot: Robot
    t: np.ndarray
    q: np.ndarray
    before: np.ndarray
    after: np.ndarray
    before_own: np.ndarray
    as_written: np.ndarray
    file_step: float
    first: int

    def rms(self) -> dict[str, np.ndarray]:
        """Root mean square of the errors by title, each (joints,) [rad or m]."""
        own = f"{1e3 * self.file_step:g} ms steps"
        made = {
            "before": self.before,
            "after": self.after,
            f"before, {own}": self.before_own,
            f"after, {own}": self.as_written,
        }
        return {
            title: np.sqrt(np.mean((self.q - own)[self.first :] ** 2, axis=0))
            for title, own in made.items()
        }

    @property
    def meaning(self) -> str:
        """What the errors by title mean."""
        return (
            "before: the description as it came; after: the written file, with the fitted delay "
            "and bias, both in Runge–Kutta steps of 0.1 ms with friction that stops a joint within "
            f"a step; the last columns have the files' own integrator and friction and "
            f"{1e3 * self.file_step:g} ms steps"
        )

    def findings(self) -> list[str]:
        """Joints that the fit has made worse, one sentence for each way of simulating it."""
        rms, sentences = list(self.rms().items()), []
        for (_, before), (title, errors) in zip(rms[::2], rms[1::2], strict=True):
            worse = ~(errors <= WORSE * before) & np.isfinite(before)
            joints = [
                f"{joint.name} {milli(error)} in place of {milli(was)} "
                + ("mrad" if joint.position_unit == "rad" else "mm")
                for joint, error, was, yes in zip(
                    self.robot.joints, errors, before, worse, strict=True
                )
                if yes
            ]
            if joints:
                sentences.append(
                    f"The fit is worse than the description on {self.name} ({title}): "
                    f"{', '.join(joints)}. Do not use it; check the law under [controller], the "
                    "control rate, and whether anything but the drives moved the joints."
                )
        return sentences


def milli(x: float) -> str:
    """An error in mrad or mm."""
    return format_significant(1e3 * x) if np.isfinite(x) else "diverged"


def held_out_errors(
    fit: SimulatorFit,
    loop: Loop,
    recording: Recording,
    original: Path,
    written: Path,
    frozen: dict[str, float],
    first: int,
) -> HeldOut:
    """Simulate a recording with MuJoCo, with the description as it came and with the fitted file.

    Args:
        fit: what was fitted.
        loop: law and gains of the record.
        recording: motion that the fit has not seen, from sample ``first`` on. What lies before is
            simulated too, from its measured position and speed, so that the start is forgotten.
        original: the description that the fit started from.
        written: file of the fitted robot, MJCF or URDF; what URDF has no place for is taken from
            the fit.
        frozen: positions of joints that are held [rad or m], by name.
        first: first sample that counts.

    Returns:
        Measured and simulated positions.

    Raises:
        RobotDescriptionError: MuJoCo refuses a file.
        ExperimentError: a law that is no sampled law of single joints.
    """
    recording, step = in_whole_periods(in_order_of(fit.robot, recording))
    names = fit.robot.joint_names
    speed = np.gradient(recording.q, axis=0) * recording.rate
    signals, _ = loop_signals(fit.robot, loop, recording, recording.q, speed)
    controller = with_measured_gravity(
        loop.controller, fit.robot, loop.drive_gain, loop.feed_forward
    )
    period = 1.0 / recording.control_rate
    begin = smooth_channels(recording.q, recording.rate).dq[0]
    given = Replay(controller, signals, recording.q, step, begin)
    fitted = replace(given, controller=fitted_controller(fit, controller, loop))
    none, specs = np.zeros(len(names)), []
    for path in (original, written):
        spec = read_spec(path)
        if path.name.endswith(URDF_FILES):
            spec.option.gravity = np.array(fit.robot.gravity, dtype=float)
        if path == written and path.name.endswith(URDF_FILES):
            for joint in spec.joints:
                joint.armature = fit.value("armature", joint.name, joint.armature)
        specs.append(held_spec(spec, names, frozen))
    late = recording.drive_delay if fit.delay is None else fit.delay.value
    file_step = float(specs[1].option.timestep)
    return HeldOut(
        name=recording.name,
        robot=fit.robot,
        t=recording.t,
        q=recording.q,
        before=replay(fine_settings(specs[0], period), names, given, recording.drive_delay, none),
        after=replay(fine_settings(specs[1], period), names, fitted, late, fit.bias),
        before_own=replay(specs[0], names, given, recording.drive_delay, none),
        as_written=replay(specs[1], names, fitted, late, fit.bias),
        file_step=min(file_step, period),
        first=first,
    )
