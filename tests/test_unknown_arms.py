"""The machines of benchmarks/unknown_arms against Pinocchio and closed forms."""

import dataclasses

import numpy as np
import pytest
from benchmarks.unknown_arms.arms import ARMS
from benchmarks.unknown_arms.judge import judge
from benchmarks.unknown_arms.logs import (
    control_rate,
    data_sheet,
    logged_ticks,
    write_log,
    write_robot,
)
from benchmarks.unknown_arms.models import urdf
from benchmarks.unknown_arms.motion import moves, repeated, sum_of_sines
from benchmarks.unknown_arms.record import users_robot, write_trace
from benchmarks.unknown_arms.simulator import Plant, simulate
from benchmarks.unknown_arms.truth import (
    machine,
    true_base_parameters,
    true_standard,
    value_of_group,
)
from benchmarks.unknown_arms.user import with_data_sheet
from scipy.integrate import solve_ivp

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor import Regressor
from pivident.robot.friction import FrictionLaw, coulomb, offset, viscous

pin = pytest.importorskip("pinocchio", exc_type=ImportError)
pytest.importorskip("mujoco")


@pytest.fixture(scope="module", params=sorted(ARMS))
def made(request):
    return machine(request.param, 3)


@pytest.fixture(scope="module")
def trace(made):
    rng = np.random.default_rng(8)
    return simulate(made, sum_of_sines("short", made.arm, rng, control_rate(made), 3.5))


def pinocchio_model(made):
    """True bodies with all rotors; what a shaft's rotor couples comes back as a matrix."""
    model = pin.buildModelFromXML(urdf(made.arm, made.bodies))
    model.armature = made.rotor.copy()
    coupled = np.zeros((made.arm.size, made.arm.size))
    for s in made.shafts:
        row = np.eye(made.arm.size)[s.motor] + s.ratio * np.eye(made.arm.size)[s.joint]
        coupled += s.inertia * np.outer(row, row)
    return model, coupled


def viscous_matrix(made):
    matrix = np.diag(made.viscous)
    for s in made.shafts:
        row = np.eye(made.arm.size)[s.motor] + s.ratio * np.eye(made.arm.size)[s.joint]
        matrix += s.viscous * np.outer(row, row)
    return matrix


def relative(found, expected):
    """Largest over the joints of the rms difference over the rms."""
    off = np.sqrt(np.mean((found - expected) ** 2, axis=0))
    return float(np.max(off / np.sqrt(np.mean(expected**2, axis=0))))


def test_the_recorded_torque_is_that_of_pinocchio(made, trace):
    model, coupled = pinocchio_model(made)
    data = model.createData()
    rows = range(0, len(trace.q), 7)
    found = np.array(
        [
            pin.rnea(model, data, trace.q_middle[k], trace.dq_middle[k], trace.ddq[k])
            + coupled @ trace.ddq[k]
            + viscous_matrix(made) @ trace.dq_middle[k]
            + trace.dry[k]
            for k in rows
        ]
    )
    assert relative(found, trace.tau[rows]) < 1e-6


def test_sensors_behind_the_gears_see_no_rotor_and_no_motor_friction():
    made = machine("link7", 3)
    rng = np.random.default_rng(8)
    trace = simulate(made, moves("short", made.arm, rng, 1000.0, 4.0))
    model = pin.buildModelFromXML(urdf(made.arm, made.bodies))
    data = model.createData()
    rows = range(0, len(trace.q), 7)
    found = np.array(
        [
            pin.rnea(model, data, trace.q_middle[k], trace.dq_middle[k], trace.ddq[k])
            + made.bearing_viscous * trace.dq_middle[k]
            + made.arm.bearing_share * trace.dry[k]
            for k in rows
        ]
    )
    assert relative(found, trace.tau_link[rows]) < 1e-6
    assert relative(trace.tau[rows], trace.tau_link[rows]) > 0.1


def test_true_base_parameters_give_the_recorded_torque(made, trace, tmp_path):
    write_robot(tmp_path, made)
    robot = users_robot(tmp_path, made)
    truth = true_base_parameters(made, robot)
    base = base_parameters(robot)
    regressor = Regressor.build(robot, base.parameters)
    values = np.array([truth[name] for name in base.names])
    phi = regressor.matrix(trace.q_middle, trace.dq_middle, trace.ddq)
    # the model's sign is smooth, the machine's is not: dry friction is compared by its levels
    smooth = [name.startswith("fc") for name in base.names]
    found = phi @ np.where(smooth, 0.0, values) + trace.dry * made.arm.bearing_share
    assert relative(found - made.offset, trace.tau_link) < 1e-6
    levels = dict(zip(base.names, values, strict=True))
    for i, level in enumerate(made.bearing_coulomb):
        assert levels[f"fc{i + 1}"] == pytest.approx(level)
    for s in made.shafts:
        assert levels[f"fcm{s.motor + 1}"] == pytest.approx(s.coulomb)


def test_steps_follow_an_independent_integration(made, trace):
    """Pinocchio's forward dynamics and an eighth-order method, from the same state."""
    model, coupled = pinocchio_model(made)
    data = model.createData()
    rate = trace.motion.rate
    ticks = round(0.06 * rate)
    speeds = trace.dq / made.arm.speeds
    rows = [
        np.eye(made.arm.size)[s.motor] + s.ratio * np.eye(made.arm.size)[s.joint]
        for s in made.shafts
    ]
    for s, row in zip(made.shafts, rows, strict=True):
        speeds = np.column_stack([speeds, trace.dq @ row / made.arm.speeds[s.motor]])
    signs = np.where(np.abs(speeds) > 0.01, np.sign(speeds), 0.0)
    steady = np.abs(np.cumsum(signs, axis=0)[ticks:] - np.cumsum(signs, axis=0)[:-ticks]).min(
        axis=1
    )
    begin = int(np.argmax(steady == ticks)) + 1
    assert steady[begin - 1] == ticks
    direction = signs[begin]
    dry = direction[: made.arm.size] * made.coulomb
    for s, row, sign in zip(made.shafts, rows, direction[made.arm.size :], strict=True):
        dry = dry + s.coulomb * sign * row
    n = made.arm.size

    def derivative(_, x, tau):
        q, dq = x[:n], x[n:]
        upper = np.triu(pin.crba(model, data, q))
        inertia = upper + np.triu(upper, 1).T + coupled
        rest = tau - dry - viscous_matrix(made) @ dq - pin.nle(model, data, q, dq)
        return np.concatenate([dq, np.linalg.solve(inertia, rest)])

    x = np.concatenate([trace.q[begin], trace.dq[begin]])
    for k in range(begin, begin + ticks):
        x = solve_ivp(
            derivative, (0.0, 1.0 / rate), x, "DOP853", args=(trace.tau[k],), rtol=1e-10, atol=1e-12
        ).y[:, -1]
    moved = np.abs(trace.q[begin + ticks] - trace.q[begin])
    assert (np.abs(x[:n] - trace.q[begin + ticks]) < 2e-5 * moved + 1e-8).all()
    assert (np.abs(x[n:] - trace.dq[begin + ticks]) < 2e-4 * np.abs(trace.dq[begin])).all()


def test_dry_friction_stops_a_joint_where_the_closed_form_says():
    made = machine("scara", 3)
    free = dataclasses.replace(made, viscous=np.zeros(4), shafts=())
    free = dataclasses.replace(free, rotor=np.array([0.77, 0.125, 2.0, 0.004]))
    plant = Plant(free, np.array(made.arm.home))
    plant.v = np.array([0.0, 0.0, 0.4, 0.0])
    # the third joint alone: it slides down, the weight pulls, dry friction brakes
    mass = free.bodies[2].mass + free.bodies[3].mass
    braking = (free.coulomb[2] + 20.0 - mass * 9.81) / (mass + 2.0)
    stop = 0.4**2 / (2 * braking)
    q = plant.q[2]
    for _ in range(round(2 * 0.4 / braking * 4000)):
        plant.step(np.array([0.0, 0.0, -20.0, 0.0]), 1 / 4000)
    assert abs(plant.q[2] - q - stop) < 1e-3 * stop
    # a torque within the dry friction about the weight moves nothing
    hold = -mass * 9.81 + 0.95 * free.coulomb[2] * np.array([1.0, -1.0])
    at = plant.q.copy()
    for force in hold:
        for _ in range(400):
            plant.step(np.array([0.0, 0.0, force, 0.0]), 1 / 4000)
        np.testing.assert_allclose(plant.q, at, atol=1e-12)


def test_a_motion_that_repeats_has_its_period():
    arm = ARMS["cobot6"]
    motion = repeated(arm, np.random.default_rng(1), 500.0, 4.0, 5)
    begin, period = 1000, 2000
    cycles = motion.q[begin : begin + 5 * period].reshape(5, period, 6)
    np.testing.assert_allclose(cycles, np.broadcast_to(cycles[0], cycles.shape), atol=1e-12)
    for signal, slope in ((motion.q, motion.dq), (motion.dq, motion.ddq)):
        found = np.gradient(signal, 1 / 500.0, axis=0)[5:-5]
        np.testing.assert_allclose(found, slope[5:-5], atol=2e-3 * np.abs(slope).max())
    assert (np.abs(motion.dq).max(axis=0) <= 0.7 * arm.speeds + 1e-9).all()


def test_the_cobots_log_has_true_uneven_stamps(tmp_path):
    made = machine("cobot6", 3)
    rng = np.random.default_rng(8)
    trace = simulate(made, sum_of_sines("short", made.arm, rng, 500.0, 3.5))
    write_log(tmp_path / "log.csv", made, trace)
    table = np.genfromtxt(tmp_path / "log.csv", names=True)
    steps = np.diff(table["timestamp"])
    ticks = np.round(1e3 * steps)
    np.testing.assert_allclose(steps, ticks * 1e-3, atol=1e-7)
    assert {10, 12} <= set(ticks.astype(int)) and len(set(ticks)) > 2
    at = np.round((table["timestamp"] - 170_000.0) * 500.0).astype(int)
    np.testing.assert_array_equal(at, logged_ticks(made, len(trace.q), _log_rng(made, trace)))
    np.testing.assert_allclose(table["actual_q_2"], trace.q_measured[at, 2], atol=1e-8)
    current = table["target_current_1"] * made.gain[1]
    np.testing.assert_allclose(current, trace.tau[at, 1], atol=1e-5)
    assert 1.0 - made.gain[1] / made.sheet_gain[1] != 0.0
    assert np.abs(made.gain / made.sheet_gain - 1).max() <= 0.03


def _log_rng(made, trace):
    return np.random.default_rng([made.seed, 4, *trace.motion.name.encode()])


def test_groups_as_printed_have_the_values_of_the_grouping(made, tmp_path):
    write_robot(tmp_path, made)
    robot = users_robot(tmp_path, made)
    base = base_parameters(robot)
    standard = true_standard(made, robot.joint_names, {})
    truth = true_base_parameters(made, robot)
    for name, expression in zip(base.names, base.expressions, strict=True):
        assert value_of_group(expression, standard) == pytest.approx(
            truth[name], rel=1e-4, abs=1e-6
        )
    assert np.isnan(value_of_group("zz1 + 0.5 nonsense", standard))


def test_what_is_attainable_is_the_truth_where_law_and_torque_constants_are_true(tmp_path):
    made = machine("scara", 5)
    write_robot(tmp_path, made)
    law = FrictionLaw((viscous(), coulomb("sign"), offset()))
    robot = users_robot(tmp_path, made).with_friction(law)
    logged = []
    for run in ("moves", "held_out"):
        rng = np.random.default_rng([1, len(run)])
        trace = simulate(made, sum_of_sines(run, made.arm, rng, 1000.0, 4.0))
        write_trace(tmp_path / f"truth_{run}.npz", made, trace)
        logged.append(trace)
    q, tau = logged[0].q_measured, logged[0].tau + made.offset
    recording = pv.Recording.from_arrays(q, tau, rate=1000.0, joint_names=robot.joint_names)
    result = pv.identify(pv.Problem(robot, (recording,)), "ls")
    result.save(tmp_path / "experiment-results" / "ls")
    judged = judge(tmp_path, made, ["moves"], "ls", 1.0)
    assert judged.names == result.names and judged.instruments == "none"
    # The truth is of the tick, its torque of the half step after it. The shaft keeps its smooth
    # sign in this law, which moves dry friction between the third joint and its motor.
    own = np.array([name not in ("fc3", "iam3", "fvm3", "fcm3") for name in judged.names])
    np.testing.assert_allclose(judged.attainable[own], judged.truth[own], rtol=2e-2, atol=2e-3)
    both = np.isin(judged.names, ["fc3", "fcm3"])
    assert judged.attainable[both].sum() == pytest.approx(judged.truth[both].sum(), rel=1e-2)
    expected = np.array([true_base_parameters(made, robot)[name] for name in result.names])
    np.testing.assert_allclose(judged.truth, expected, rtol=1e-4, atol=1e-6)
    assert judged.held_out < 3.0


def test_a_user_writes_what_the_data_sheet_says():
    sheet = data_sheet(machine("cobot6", 1))
    own = {"files": "a.csv", "units": {"tau": [{"unit": "A", "gain": 1.0, "scale": "masses"}]}}
    tables = with_data_sheet({"recording": [own], "robot": {}}, sheet)
    gains = [unit["gain"] for unit in tables["recording"][0]["units"]["tau"]]
    np.testing.assert_allclose(gains, machine("cobot6", 1).sheet_gain)
    assert tables["recording"][0]["control_rate"] == 500.0
    assert "scale" not in tables["recording"][0]["units"]["tau"][0]
