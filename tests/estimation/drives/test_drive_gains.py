"""Drive gains of a simulated arm in amperes: with a payload, a trusted number, or nothing."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.drives.drive_equations import Trusted, motor_coupling
from pivident.estimation.drives.drive_gains import identify_drive_gains
from pivident.estimation.drives.known_payload import Payload
from pivident.estimation.drives.log_units import gain_groups, identify_in_log_units
from pivident.foundation.errors import ExperimentError
from pivident.robot.gallery import load_robot
from pivident.robot.inertia import from_center_of_mass, tensor
from tests.payload_scenario import PAYLOAD, tx40_in_amperes


@pytest.fixture(scope="module")
def arm():
    return tx40_in_amperes(0, samples=10000)


@pytest.fixture(scope="module")
def with_payload(arm):
    return identify_drive_gains(arm.problem, arm.payload, [arm.loaded])


@pytest.fixture(scope="module")
def without_payload(arm):
    return identify_drive_gains(replace(arm.problem, loop=None))


def test_a_known_payload_gives_all_gains_within_one_percent(arm, with_payload):
    error = with_payload.kappa / arm.gains - 1.0
    assert with_payload.method == "instrumental variables" and not with_payload.warnings
    assert np.abs(error).max() < 0.005
    assert np.abs(error / (with_payload.std / with_payload.kappa)).max() < 4.0
    assert with_payload.anchored.all() and len(with_payload.groups) == 1


def test_commands_as_regressors_make_gains_too_small(arm, with_payload):
    error = {name: g / arm.gains - 1.0 for name, (g, _) in with_payload.literature.items()}
    assert (error["wls"] < -0.01).all() and error["wls"].min() < -0.03
    assert np.abs(error["mixed-tls"]).max() < 0.005
    # all columns equally noisy is another error, not none
    assert np.abs(error["tls"]).max() > 0.01


def test_common_parameters_explain_as_much_as_each_motors_own(with_payload):
    np.testing.assert_allclose(with_payload.residual, with_payload.own_residual, rtol=0.01)


def test_the_mass_alone_is_enough(arm, with_payload):
    found = identify_drive_gains(arm.problem, Payload(mass=2.0), [arm.loaded])
    assert np.abs(found.kappa / arm.gains - 1.0).max() < 0.01
    assert (found.std > with_payload.std).sum() >= 5


def test_without_payload_ratios_are_known_and_the_scale_is_not(arm, without_payload):
    (group,) = without_payload.groups
    assert group.motors == tuple(range(6)) and not group.anchored
    for m in range(6):
        value, std = without_payload.ratio(m, group.reference)
        true = arm.gains[m] / arm.gains[group.reference]
        assert abs(value - true) <= 4.0 * std
        assert 2.0 * std <= without_payload.known_within * abs(value)
    # and nothing is claimed of the scale itself
    assert (np.sqrt(np.diag(without_payload.log_covariance)) > 1.0).all()
    assert without_payload.literature == {}


def test_a_trusted_gain_fixes_the_scale_and_its_doubt_is_passed_on(arm, without_payload):
    problem = replace(arm.problem, loop=None)
    trusted = {"joint_2": Trusted(arm.gains[1], 0.03 * arm.gains[1])}
    found = identify_drive_gains(problem, trusted_gains=trusted)
    assert found.anchored.all()
    relative = found.std / found.kappa
    assert relative[1] == pytest.approx(0.03, rel=1e-2)
    value, std = without_payload.ratio(2, 1)
    assert found.kappa[2] == pytest.approx(arm.gains[1] * value, rel=2e-3)
    assert relative[2] == pytest.approx(np.hypot(0.03, std / value), rel=0.02)


def test_a_trusted_parameter_fixes_the_scale(arm):
    base = arm.problem.base
    mx2 = base.values(nominal_values(base.robot, base.standard))[base.index("mx2")]
    found = identify_drive_gains(
        replace(arm.problem, loop=None), trusted_parameters={"mx2": Trusted(mx2, 0.02 * mx2)}
    )
    assert found.anchored.all()
    assert np.abs(found.kappa / arm.gains - 1.0)[:3].max() < 0.01
    assert (found.std / found.kappa)[1] == pytest.approx(0.02, rel=0.05)


def test_doubt_about_the_mass_is_passed_on(arm, with_payload):
    doubted = replace(arm.payload, mass_std=0.02)
    found = identify_drive_gains(replace(arm.problem, loop=None), doubted, [arm.loaded])
    # ten times the mass's own interval: gains go with the mass, nearly in proportion
    assert (found.std / found.kappa) == pytest.approx(0.01, rel=0.25)


def test_other_friction_under_load_is_not_taken_for_a_gain():
    arm = tx40_in_amperes(1, samples=10000, friction_factor=1.3)
    problem = replace(arm.problem, loop=None)
    free = identify_drive_gains(problem, arm.payload, [arm.loaded])
    same = identify_drive_gains(problem, arm.payload, [arm.loaded], friction_under_load=False)
    assert np.abs(free.kappa / arm.gains - 1.0).max() < 0.005
    assert np.abs(same.kappa / arm.gains - 1.0).max() > 0.02


def test_a_turned_sign_is_found_and_said(arm):
    def turned(recording):
        coupling = motor_coupling(arm.problem.robot.transmission)
        commands = np.linalg.solve(coupling, recording.tau.T)
        commands[2] *= -1.0
        return replace(recording, tau=(coupling @ commands).T)

    problem = replace(
        arm.problem, recordings=tuple(turned(r) for r in arm.problem.recordings), loop=None
    )
    found = identify_drive_gains(problem, arm.payload, [turned(arm.loaded)])
    assert found.kappa[2] == pytest.approx(-arm.gains[2], rel=0.005)
    assert (np.delete(found.kappa, 2) > 0).all()
    assert any("joint_3" in w and "opposite sign" in w for w in found.warnings)


def test_log_units_are_parameters_over_gains(arm):
    rows = identify_in_log_units(replace(arm.problem, loop=None), "A")
    base = arm.problem.base
    truth = dict(
        zip(base.names, base.values(nominal_values(base.robot, base.standard)), strict=True)
    )
    row = rows[1]
    assert row.joint == "joint_2" and row.relative_error < 0.1
    at = [row.names.index(name) for name in ("mx2r", "fv2", "fc2", "zz2r")]
    wanted = [truth[row.names[k]] / arm.gains[1] for k in at]
    assert np.abs((row.values[at] - wanted) / row.std[at]).max() < 4.0
    assert row.units[at[0]] == "kg m/(N m/A)"


def test_a_payload_adds_what_a_heavier_link_has():
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    body = from_center_of_mass(
        PAYLOAD.mass, np.array(PAYLOAD.center_of_mass), tensor(np.array(PAYLOAD.inertia))
    )
    links = list(robot.links)
    links[-1] = replace(links[-1], inertia=links[-1].inertia + body)
    heavier = replace(robot, links=tuple(links))
    difference = base.values(nominal_values(heavier, base.standard)) - base.values(
        nominal_values(robot, base.standard)
    )
    np.testing.assert_allclose(PAYLOAD.base_columns(base) @ PAYLOAD.known(), difference, atol=1e-12)


def test_coupling_of_motors_is_the_transmissions(arm):
    transmission = arm.problem.robot.transmission
    commands = np.random.default_rng(0).standard_normal((5, 6))
    torques = transmission.joint_torques(commands)
    own = commands * np.diag(transmission.reduction)
    np.testing.assert_allclose(own @ motor_coupling(transmission).T, torques, rtol=1e-12)


def test_groups_are_the_components_of_known_ratios():
    # 0-1 common scale, 2 alone, 3 known by itself
    scale = 4.0
    spread = np.diag([1e-4, 1e-4, 1.0, 1e-3]) + np.zeros((4, 4))
    spread[:2, :2] += scale
    groups = gain_groups(spread, 0.25)
    assert [(g.motors, g.anchored) for g in groups] == [
        ((3,), True),
        ((0, 1), False),
        ((2,), False),
    ]
    assert gain_groups(spread, 1e-3)[0].motors != (3,)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (dict(mass=-1.0), "mass"),
        (dict(mass=1.0, inertia=[0.0] * 6), "center_of_mass"),
        (dict(mass=1.0, center_of_mass=[0.0, 1.0]), "3 numbers"),
        (dict(mass=1.0, mass_std=2.0), "mass_std"),
        (dict(mass=1.0, center_of_mass=[0, 0, 0], inertia=[-1.0, 0, 0, 1, 0, 1]), "negative"),
    ],
)
def test_wrong_payloads_are_refused(wrong, says):
    with pytest.raises(ExperimentError, match=says):
        Payload(**wrong)


def test_wrong_requests_are_refused(arm):
    with pytest.raises(ExperimentError, match="belong together"):
        identify_drive_gains(arm.problem, arm.payload)
    with pytest.raises(ExperimentError, match="joint_2"):
        identify_drive_gains(arm.problem, trusted_gains={"joint2": 1.0})
    with pytest.raises(ExperimentError, match="mx2"):
        identify_drive_gains(arm.problem, trusted_parameters={"mx22": 1.0})
    with pytest.raises(ExperimentError, match="other than 0"):
        identify_drive_gains(arm.problem, trusted_gains={"joint_2": 0.0})
