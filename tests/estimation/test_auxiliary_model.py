"""What drives the simulated loop of a recording."""

import numpy as np

import pivident as pv
from pivident.estimation.auxiliary_model import SHAKEN, loop_signals
from tests.planar_arm import LAW, nominal_parameters

RATE = 1000.0


def test_a_joint_at_rest_may_be_shaken_by_the_one_that_moves():
    base, _ = nominal_parameters()
    t = np.arange(2000) / RATE
    q = np.column_stack([np.sin(t), np.zeros(t.size)])
    dq = np.column_stack([np.cos(t), np.zeros(t.size)])
    recording = pv.Recording(
        "run", base.robot.joint_names, q, q + 1.0, RATE, q_ref=q, allow_constant=True
    )
    signals, _ = loop_signals(base.robot, pv.Loop(LAW), recording, q, dq)
    np.testing.assert_allclose(signals.speed_bound, [5.0 + 1e-3, 5.0 * SHAKEN + 1e-3])
