"""A friction law of your own: a function of position, speed and load, from simulation to C."""

import numpy as np

import pivident as pv
from pivident.dynamics import own_friction
from pivident.models import export_model, runnable_model
from pivident.robot import FrictionLaw, viscous

C = """double gear(double dq, double load)
{
    return (1.0 + 0.02 * fabs(load)) * tanh(40.0 * dq);
}"""


def gear(dq: float, load: float) -> float:
    """Dry friction that grows with the torque that the gear carries."""
    return float((1.0 + 0.02 * abs(load)) * np.tanh(40.0 * dq))


def main() -> tuple[pv.Identification, pv.Identification, bytes]:
    """The estimate with this friction, that with plain Coulomb friction, and the C file."""
    plain, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
    law = FrictionLaw((viscous(), own_friction("gear", gear, c_source=C)))
    robot = plain.with_friction(law)
    values = {"gear1": 4.0, "gear2": 1.5, "fv1": 3.0, "fv2": 1.0}
    record = pv.simulate(
        robot, loop, values=values, duration=6.0, encoder=2e-5, torque=[0.3, 0.1], seed=1
    ).recording
    found = pv.identify(pv.Problem(robot, (record,), loop), "piv")
    usual = pv.identify(pv.Problem(plain, (record,), loop), "piv")
    return found, usual, export_model(runnable_model(found), "c").content


if __name__ == "__main__":
    print(main()[0])
