"""A log of a leg that hangs in the air, simulated by MuJoCo: writes leg.xml, log.csv and leg.toml.

The drives run a PD law at 400 Hz, whose torque acts 3.2 ms late; the log has 200 samples a second
of commanded positions and of encoders with 14 bits. ``leg.xml`` is what CAD knows: links, but no
armature, damping or friction. ``pivident fit-simulator leg.toml`` finds them.

    python examples/suspended_leg/simulate_log.py
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

LEG = """<mujoco model="leg">
  <compiler angle="radian"/>
  <option timestep="0.001"/>
  <worldbody>
    <body name="hip">
      <joint name="abduction" axis="1 0 0"/>
      <inertial pos="0 0.01 0" mass="0.7" diaginertia="5e-4 9e-4 6e-4"/>
      <body name="thigh" pos="0 0.08 0">
        <joint name="hip" axis="0 1 0"/>
        <inertial pos="0 0.02 -0.06" mass="1" diaginertia="5e-3 5e-3 1e-3"/>
        <body name="shank" pos="0 0 -0.21">
          <joint name="knee" axis="0 1 0"/>
          <inertial pos="0.01 0 -0.1" mass="0.25" diaginertia="2.5e-3 2.5e-3 5e-5"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

EXPERIMENT = """robot = "leg.xml"

[recording]
files = "log.csv"
units = {q = "rad", q_ref = "rad", tau = "N m"}
control_rate = 400.0

[recording.columns]
t = "t"
q = ["q_abduction", "q_hip", "q_knee"]
q_ref = ["target_abduction", "target_hip", "target_knee"]
tau = ["command_abduction", "command_hip", "command_knee"]

[controller]
type = "pd"
kp = 40.0     # N m/rad
kd = 1.0      # N m s/rad
"""

NAMES = ("abduction", "hip", "knee")

#: What the fit has to find, and the delay of the torque [s].
ARMATURE, DAMPING = np.array([0.012, 0.010, 0.015]), np.array([0.08, 0.12, 0.06])
FRICTIONLOSS, BIAS = np.array([0.15, 0.20, 0.10]), np.array([0.02, -0.03, 0.01])
DELAY = 3.2e-3

KP, KD, RATE, SECONDS, COUNT = 40.0, 1.0, 400.0, 12.0, 2.0 * np.pi / 2**14
STEPS = 25  # of MuJoCo in a period of the loop


def true_leg() -> mujoco.MjModel:
    """The leg with its joints, and friction that is as hard as MuJoCo has it."""
    spec = mujoco.MjSpec.from_string(LEG)
    spec.option.timestep = 1.0 / RATE / STEPS
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for k, joint in enumerate(spec.joints):
        joint.armature, joint.damping[0] = ARMATURE[k], DAMPING[k]
        joint.frictionloss = FRICTIONLOSS[k]
        joint.solref_friction[:2] = (-1.0, -1e6)
        joint.solimp_friction[:5] = (0.9999, 0.9999, 0.001, 0.5, 2.0)
    return spec.compile()


def main(folder: Path = Path()) -> None:
    """Simulate, and write the three files into a folder."""
    model = true_leg()
    data = mujoco.MjData(model)
    t = np.arange(int(SECONDS * RATE)) / RATE
    chirp = 0.3 * np.minimum(t, 1.0) * np.sin(2.0 * np.pi * (0.1 * t + 0.3 * t**2))
    target = np.array([0.0, 0.6, -1.2]) + np.stack([chirp, -chirp, 0.8 * chirp], axis=1)
    late = DELAY * RATE * STEPS  # in steps of MuJoCo; whole ones here
    periods, steps = divmod(round(late), STEPS)
    data.qpos[:] = target[0] - BIAS
    rows, torques, before = [], [], None
    for k in range(len(t)):
        read = COUNT * np.round((data.qpos + BIAS) / COUNT)
        moved = target[k] - target[max(k - 1, 0)] - read + (read if before is None else before)
        torques.append(KP * (target[k] - read) + KD * RATE * moved)
        before = read
        if k % 2 == 0:
            rows.append([t[k], *read, *target[k], *torques[-1]])
        for which, count in ((1, steps), (0, STEPS - steps)):
            data.qfrc_applied[:] = torques[max(k - periods - which, 0)]
            mujoco.mj_step(model, data, count)
    columns = [f"{kind}_{name}" for kind in ("q", "target", "command") for name in NAMES]
    header = ",".join(["t", *columns])
    np.savetxt(folder / "log.csv", rows, delimiter=",", header=header, comments="", fmt="%.10g")
    (folder / "leg.xml").write_text(LEG, encoding="utf-8")
    (folder / "leg.toml").write_text(EXPERIMENT, encoding="utf-8")
    print(f"{len(rows)} samples in log.csv")


if __name__ == "__main__":
    main()
