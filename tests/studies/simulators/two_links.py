"""Two links that position actuators of MuJoCo move, and a log of commands and positions."""

import mujoco
import numpy as np

#: Of shoulder and elbow; the file that a fit starts from has none of them.
TRUE = {"armature": (0.045, 0.012), "damping": (0.35, 0.12), "frictionloss": (0.6, 0.25)}
KP, KV = (60.0, 25.0), (2.0, 0.8)

#: Steps of MuJoCo in a sample of the log, and its rate [Hz].
STEPS, RATE = 4, 250.0

MODEL = """<mujoco model="two_links"><compiler angle="radian"{compiler}/>
<option timestep="0.001" integrator="implicitfast"/>{more}
<worldbody><body pos="0 0 1"><joint name="shoulder" axis="0 1 0"/>
<inertial pos="0 0 -.2" mass="1.6" diaginertia=".03 .03 .004"/>{shape}
<body pos="0 0 -.4"><joint name="elbow" axis="0 1 0"/>
<inertial pos="0 0 -.15" mass=".9" diaginertia=".012 .012 .001"/></body></body></worldbody>
<actuator>{actuators}</actuator></mujoco>"""

POSITIONS = "".join(
    f'<position name="{name}" joint="{name}" kp="{kp:g}" kv="{kv:g}"/>'
    for name, kp, kv in zip(("shoulder", "elbow"), KP, KV, strict=True)
)


def model_text(actuators=POSITIONS, compiler="", more="", shape=""):
    """The file that a fit starts from."""
    return MODEL.format(actuators=actuators, compiler=compiler, more=more, shape=shape)


def with_values(text, values, hard=True, step=0.001):
    """A spec with other joints, whose dry friction stops them within a step or is MuJoCo's soft."""
    spec = mujoco.MjSpec.from_string(text)
    for k, joint in enumerate(spec.joints):
        joint.armature, joint.frictionloss = values["armature"][k], values["frictionloss"][k]
        joint.damping[0] = values["damping"][k]
        if not hard:
            continue
        joint.solref_friction[:2] = (-1.0, -1.0 / step)
        joint.solimp_friction[:5] = (0.9999, 0.9999, 0.001, 0.5, 2.0)
    return spec


def commands(t):
    """Swings with turns at all speeds, and their start from rest, shape (samples, 2) [rad]."""
    ramp = np.minimum(t / 1.0, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(t / 1.0, 1.0))
    shoulder = 0.5 * np.sin(2.1 * t + 0.35 * t**2) + 0.3 * np.sin(0.9 * t)
    elbow = 0.7 * np.sin(2.9 * t + 0.3 * t**2) - 0.3 * np.sin(1.3 * t)
    return ramp[:, None] * np.stack([shoulder, elbow], axis=1)


def write_log(path, text=None, values=TRUE, seconds=7.0, first=0.0, hard=True):
    """Let MuJoCo move the true links and log commands and positions from ``first`` [s] on."""
    model = with_values(text or model_text(), values, hard).compile()
    data, rng = mujoco.MjData(model), np.random.default_rng(4)
    rows = []
    steps = np.arange(round(seconds * RATE) * STEPS)
    for step, command in zip(steps, commands(steps / STEPS / RATE), strict=True):
        if step % STEPS == 0:
            t = step / STEPS / RATE
            rows.append([t, *(data.qpos + 1e-5 * rng.standard_normal(2)), *command])
        data.ctrl[:2] = command
        mujoco.mj_step(model, data)
    rows = [row for row in rows if row[0] >= first - 1e-9]
    lines = [",".join(f"{x:.7f}" for x in row) for row in rows]
    head = "time,shoulder_pos,elbow_pos,shoulder_cmd,elbow_cmd"
    path.write_text("\n".join([head, *lines]) + "\n")
