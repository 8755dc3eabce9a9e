import tomllib

import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.naming import (
    errors_name,
    find_joint,
    frozen_example,
    near_names,
    nearest,
    repeated,
)

NAMES = ("shoulder", "elbow", "wrist")


def test_a_joint_is_found_by_name_and_by_its_number_from_one():
    assert find_joint(NAMES, "elbow") == 1
    assert find_joint(NAMES, "3") == 2


def test_a_name_that_looks_like_a_number_wins_over_the_number():
    assert find_joint(("2", "1"), "2") == 0


@pytest.mark.parametrize("number", ["0", "4", "-1"])
def test_a_joint_number_outside_the_robot_is_refused(number):
    with pytest.raises(RobotDescriptionError, match=f"joint number {number}.*from 1 to 3"):
        find_joint(NAMES, number)


def test_a_misspelt_joint_gets_the_nearest_name():
    with pytest.raises(RobotDescriptionError, match="'elbwo'; did you mean 'elbow'"):
        find_joint(NAMES, "elbwo")


def test_a_name_like_no_other_gets_the_whole_list():
    assert nearest("gripper", NAMES) == "known are 'shoulder', 'elbow', 'wrist'"
    assert nearest("gripper", ()) == "known are none"


def test_case_does_not_hide_what_was_meant():
    assert nearest("Elbow", NAMES) == "did you mean 'elbow'?"
    assert nearest("kP", ("kp", "kd")) == "did you mean 'kp'?"


def test_the_nearest_name_comes_first_and_letters_in_disorder_last():
    known = ["tau_2", "tau2", "position"]
    assert near_names("tau1", known) == ["tau2", "tau_2"]
    assert near_names("TAU2", known)[0] == "tau2"
    assert near_names("pk", ["kp", "kd"]) == ["kp"]
    assert near_names("effort", known) == []


def test_names_less_alike_are_found_where_that_is_allowed():
    assert near_names("/states", ["/arm/joint_states"]) == []
    assert near_names("/states", ["/arm/joint_states"], likeness=0.5) == ["/arm/joint_states"]


@pytest.mark.parametrize("name", ["elbow", "left arm/elbow"])
def test_a_frozen_joint_is_shown_as_toml(name):
    text, table = frozen_example(name).split(" under ")
    assert tomllib.loads(text) == {"frozen": {name: 0.0}} and table == "[robot]"


def test_repeated_names_are_listed_once():
    assert repeated(["b", "a", "b", "a", "c"]) == ["a", "b"]


def test_errors_name_their_source():
    with pytest.raises(RobotDescriptionError, match=r"^arm\.urdf: broken$"):
        with errors_name("arm.urdf"):
            raise RobotDescriptionError("broken")
