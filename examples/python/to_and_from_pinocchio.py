"""From a Pinocchio model to an estimate, and from the estimate back to Pinocchio and MuJoCo."""

import mujoco
import numpy as np
import pinocchio
from numpy.typing import NDArray

import pivident as pv
from pivident.models import export_model, runnable_model
from pivident.robot import FrictionLaw, viscous

Array = NDArray[np.float64]


def main() -> tuple[Array, Array, Array]:
    """Torques of the identified model: of pivident, Pinocchio and MuJoCo, at random states."""
    arm = pinocchio.buildSampleModelManipulator()  # six axes
    arm.velocityLimit, arm.armature = np.full(6, 2.0), np.full(6, 0.5)  # rad/s, kg m²
    robot = pv.Robot.from_pinocchio(arm, FrictionLaw((viscous(),)))
    loop, values = pv.Loop(pv.PD([4000.0] * 6, [300.0] * 6)), {f"fv{j}": 2.0 for j in range(1, 7)}
    record = pv.simulate(robot, loop, values=values, duration=8.0, torque=0.1, seed=1)
    found = pv.identify(pv.Problem(robot, (record.recording,), loop), "ls")
    model = runnable_model(pv.make_consistent(found))  # bodies that exist
    states = list(zip(*np.random.default_rng(0).uniform(-1.0, 1.0, (3, 20, 6)), strict=True))

    file = export_model(model, "urdf")  # a URDF has no rotors: they are set by hand
    back, rotors = pinocchio.buildModelFromXML(file.text), model.values[10::12]
    data, back.armature = back.createData(), rotors
    rnea = [pinocchio.rnea(back, data, *x) + np.asarray(back.damping) * x[1] for x in states]

    simulator = mujoco.MjModel.from_xml_string(export_model(model, "mjcf").text)
    state, inverse = mujoco.MjData(simulator), []
    for state.qpos[:], state.qvel[:], state.qacc[:] in states:
        mujoco.mj_inverse(simulator, state)
        inverse.append(state.qfrc_inverse.copy())
    return np.array([model.torque(*x) for x in states]), np.array(rnea), np.array(inverse)


if __name__ == "__main__":
    print(*(np.abs(torque).max() for torque in main()))
