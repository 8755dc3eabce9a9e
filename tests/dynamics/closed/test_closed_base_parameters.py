"""Base parameters of closed mechanisms: their number, their groups, a closed form."""

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from tests.dynamics.closed.mechanisms import (
    MECHANISMS,
    VISCOUS,
    delta,
    five_bar,
    parallelogram,
    spatial_loop,
    states,
)
from tests.forward_dynamics import acceleration

SIZES = MECHANISMS | {
    "delta without friction": delta,
    "three in a loop": lambda: spatial_loop(3, "full", 3),
}


def projected(robot, parameters, q, dq, ddq):
    """Nᵀ Y at states, the matrix of the tree between the gains, (samples, joints, parameters)."""
    tree, chains = Regressor.build(robot.tree, parameters), ClosedChains(robot)
    rows = []
    for one in zip(q, dq, ddq, strict=True):
        motion = chains.motion(*(x[:, None] for x in one))
        whole = tree.matrix(*(x.T.copy() for x in motion[:3]))[0]
        rows.append(motion.gain[:, :, 0].T @ whole)
    return np.array(rows)


@pytest.mark.parametrize("name", SIZES)
def test_their_number_is_the_rank_over_random_postures(name):
    robot = SIZES[name]()
    base = base_parameters(robot)
    phi = projected(robot, base.standard, *states(robot, 500, 21, speed=3.0))
    phi = phi.reshape(-1, len(base.standard))
    length = np.linalg.norm(phi, axis=0)
    seen = length > 1e-10 * length.max()
    sizes = np.linalg.svd(phi[:, seen] / length[seen], compute_uv=False)
    rank = int((sizes > 1e-10 * sizes[0]).sum())
    assert sizes[rank - 1] > 1e4 * sizes[rank]
    assert len(base) == rank
    assert sorted(base.without_effect) == sorted(np.flatnonzero(~seen))
    assert len(base) + base.dropped.size + base.without_effect.size == len(base.standard)


@pytest.mark.parametrize("name", SIZES)
def test_base_parameters_give_the_torques_of_all(name):
    robot = SIZES[name]()
    base = base_parameters(robot)
    theta = np.random.default_rng(3).uniform(-1.0, 1.0, len(base.standard))
    groups = base.values(theta)
    motion = states(robot, 60, 22, speed=2.0)
    whole = projected(robot, base.standard, *motion) @ theta
    size = np.abs(whole).max()
    for parameters, values in (
        (base.standard, theta),
        (base.parameters, groups),
        (base.standard, base.standard_from_base(groups)),
    ):
        tau = regressor_of(robot, parameters).torque(*motion, values)
        np.testing.assert_allclose(tau, whole, rtol=0, atol=1e-10 * size)
        phi = regressor_of(robot, parameters).matrix(*motion)
        np.testing.assert_allclose(phi @ values, whole, rtol=0, atol=1e-10 * size)


@pytest.mark.parametrize("name", ["five bar", "delta", "hinge"])
def test_base_parameters_give_the_accelerations_of_all(name):
    robot = MECHANISMS[name]()
    base = base_parameters(robot)
    theta = nominal_values(robot, base.standard)
    q, dq, tau = states(robot, 20, 23, speed=2.0)
    expected = acceleration(robot, base.standard, theta, q, dq, tau)
    ours = acceleration(robot, base.parameters, base.values(theta), q, dq, tau)
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_the_parallelogram_has_four_of_them():
    crank = 0.4
    robot = parallelogram(crank=crank, law=VISCOUS)
    base = base_parameters(robot)
    assert base.names == ("zzr[crank]", "mxr[crank]", "myr[crank]", "fvr[crank]")
    by_name = {p.name: np.eye(len(base.standard))[k] for k, p in enumerate(base.standard)}
    for part, effect in {
        "zz[crank]": (1, 0, 0, 0),
        "zz[rocker]": (1, 0, 0, 0),
        "ia[crank]": (1, 0, 0, 0),
        "m[coupler]": (crank**2, crank, 0, 0),
        "mx[crank]": (0, 1, 0, 0),
        "mx[rocker]": (0, 1, 0, 0),
        "my[rocker]": (0, 0, 1, 0),
        "fv[coupler]": (0, 0, 0, 1),
        "fv[rocker]": (0, 0, 0, 1),
        "zz[coupler]": (0, 0, 0, 0),
        "mx[coupler]": (0, 0, 0, 0),
        "my[coupler]": (0, 0, 0, 0),
        "xx[crank]": (0, 0, 0, 0),
    }.items():
        np.testing.assert_allclose(base.values(by_name[part]), effect, rtol=0, atol=1e-9)


def test_a_hinge_and_a_ball_at_the_tip_of_a_five_bar_are_one():
    ball, hinged = five_bar(kind="point"), five_bar(kind="axis")
    assert base_parameters(ball).expressions == base_parameters(hinged).expressions


def test_links_that_are_no_bodies_and_passive_joints_have_no_parameters_of_their_own():
    names = {p.name for p in base_parameters(delta()).standard}
    assert not {n for n in names if "fork" in n or n in ("m[x]", "m[y]")}
    assert {n for n in names if n.startswith("ia")} == {"ia[arm1]", "ia[arm2]", "ia[arm3]"}
    assert {n for n in names if n.startswith("m[")} == {
        f"m[{joint}]" for joint in ("arm1", "arm2", "arm3", "rod1", "rod2", "rod3", "z")
    }
