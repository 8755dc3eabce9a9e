"""A robot changed by a little keeps the entries of its regressor; only its geometry is new."""

import numpy as np
import pytest

import pivident as pv
from pivident.dynamics.regressor import Regressor
from pivident.judgement.model_errors import motion_errors
from pivident.judgement.model_errors.cause import RecordMotion


@pytest.mark.parametrize("name", ["planar_2r", "staubli_tx40"])
@pytest.mark.parametrize("way", ["moved", "turned", "tilted"])
def test_entries_in_another_geometry_are_those_of_the_robot_built_anew(name, way):
    robot = pv.load_robot(name)
    parameters = pv.base_parameters(robot).parameters
    regressor = Regressor.build(robot, parameters)
    rng = np.random.default_rng(0)
    motion = rng.uniform(-2.0, 2.0, (3, 40, robot.size))
    theta = rng.normal(size=len(parameters))
    differs = False
    for j in range(robot.size):
        change = {
            "moved": motion_errors._moved(j, 0),
            "turned": motion_errors._turned(j, 1),
            "tilted": motion_errors._tilted(0),
        }[way]
        own = motion_errors._regressor_after(change, 1e-3, regressor)
        anew = Regressor.build(change(robot, 1e-3), parameters, probed=False)
        assert np.array_equal(own.torque(*motion, theta), anew.torque(*motion, theta))
        differs |= not np.array_equal(own.torque(*motion, theta), regressor.torque(*motion, theta))
    assert differs


def places_in_play(pull):
    place = np.empty(pull.size)
    motion_errors.find_places_in_play(pull, place)
    return place


def test_a_link_flies_from_flank_to_flank_by_the_third_power_of_time():
    samples = np.arange(200.0)
    slope = 6.0 / 30.0**3  # the width is passed in thirty samples: slope t³/6 = 1
    place = places_in_play(slope * (samples - 50.0))
    np.testing.assert_array_equal(place[:51], -0.5)
    flight = samples[51:78] - 50.0
    np.testing.assert_allclose(place[51:78], -0.5 + slope * flight**3 / 6.0, atol=0.1)
    assert place[75] < 0.5
    np.testing.assert_array_equal(place[82:], 0.5)


def test_play_is_one_sided_where_the_pull_is_and_passed_at_once_where_it_is_strong():
    turns = np.sin(np.linspace(0.0, 20.0, 500))
    np.testing.assert_array_equal(places_in_play(-1.5 + turns), -0.5)
    np.testing.assert_array_equal(places_in_play(1e6 * turns), 0.5 * np.sign(turns + 1e-300))
    back = places_in_play(np.repeat([1.0, -1e-4, 1.0], [5, 20, 5]))
    assert back[:5].min() == 0.5 and -0.5 < back[24] < 0.5 and back[-1] == 0.5


def test_what_a_gear_transmits_has_no_rotor_in_it():
    robot = pv.load_robot("staubli_tx40")
    parameters = pv.base_parameters(robot).parameters
    rng = np.random.default_rng(1)
    q, dq, ddq = rng.uniform(-2.0, 2.0, (3, robot.size, 30))
    theta = rng.uniform(1.0, 2.0, len(parameters))
    motion = RecordMotion(Regressor.build(robot, parameters), theta, q, dq, ddq, 100.0, 0)
    rotors = {p.joint: value for p, value in zip(parameters, theta, strict=True) if p.stem == "ia"}
    del rotors[4], rotors[5]  # whose motors turn both axes
    assert rotors
    for j, rotor in rotors.items():
        np.testing.assert_allclose(motion.load[j] - motion.transmitted[j], rotor * ddq[j])
        whole = motion.along(j, (0 * q[j], 0 * q[j], 0 * q[j] + 1.0), 1e-6)[j]
        np.testing.assert_allclose(motion.transmitted_by_acceleration(j), whole - rotor, rtol=1e-6)
