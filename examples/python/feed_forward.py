"""Feed-forward: the torque of a result in a loop, and the same function in C."""

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import pivident as pv
from pivident.models import export_model, runnable_model

Array = NDArray[np.float64]


def main() -> tuple[Array, Array, Array]:
    """Torques along the reference: called state by state, all at once, and in C."""
    robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
    record = pv.simulate(robot, loop, duration=4.0, torque=0.1, seed=1)
    found = pv.identify(pv.Problem(robot, (record.recording,), loop), "ls")
    q = np.asarray(record.recording.q_ref)[:500]
    dq = np.gradient(q, 1e-3, axis=0)
    states = (q, dq, np.gradient(dq, 1e-3, axis=0))
    single = np.array([found.torque(*state) for state in zip(*states, strict=True)])

    exported = export_model(runnable_model(found), "c", name="arm")
    with tempfile.TemporaryDirectory() as folder:
        for name, content in {"arm.c": exported.content, **exported.further}.items():
            Path(folder, name).write_bytes(content)
        subprocess.run("cc -shared -fPIC -o arm.so arm.c -lm".split(), cwd=folder, check=True)
        function = ctypes.CDLL(f"{folder}/arm.so").arm_inverse_dynamics
        of_c = np.empty_like(q)
        for state in zip(*states, of_c, strict=True):
            function(*(x.ctypes.data_as(ctypes.c_void_p) for x in state))
    return single, found.torque(*states), of_c


if __name__ == "__main__":
    print(abs(main()[0] - main()[2]).max())
