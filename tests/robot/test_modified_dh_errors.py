"""Every way in which a modified DH file can be wrong, and what its error says."""

import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.modified_dh import parse_modified_dh, read_modified_dh

TWO = """
name = "two"
{top}
[[joints]]
name = "upper"
{upper}
[[joints]]
name = "lower"
{lower}
{end}
"""


def two(top="", upper="", lower="", end=""):
    return TWO.format(top=top, upper=upper, lower=lower, end=end)


WRONG = [
    (two(top="nmae = 1"), r"unknown key 'nmae'; did you mean 'name'"),
    (two(lower="alhpa = 0.1"), r"joint 'lower': unknown key 'alhpa'; did you mean 'alpha'"),
    (two(lower="link = {mas = 2}"), r"joint 'lower': unknown key 'link.mas'; did you mean 'mass'"),
    (two(lower="link = {}"), r"joint 'lower': key 'link.mass' is missing; add it"),
    (two(lower='alpha = "90"'), r"joint 'lower': key 'alpha' = '90': must be a valid number"),
    (two(lower="alpha = true"), r"joint 'lower': key 'alpha' = True"),
    (two(lower="alpha = nan"), r"joint 'lower': key 'alpha' = nan: .* finite number"),
    (two(lower="r = inf"), r"joint 'lower': key 'r' = inf"),
    (two(lower='kind = "ball"'), r"joint 'lower': key 'kind' = 'ball': .*'revolute'"),
    (
        two(lower="position_limits = [1]"),
        r"'position_limits' = \[1\]: must have at least 2 items, not 1",
    ),
    (two(lower="position_limits = [1, 1]"), r"joint 'lower': empty position range"),
    (two(lower="rated_speed = 0"), r"key 'rated_speed' = 0: must be greater than 0"),
    (two(lower="torque_limit = -2"), r"key 'torque_limit' = -2: must be greater than 0"),
    (two(lower="rotor_inertia = -1"), r"key 'rotor_inertia' = -1"),
    (two(lower="link = {mass = -1}"), r"key 'link.mass' = -1"),
    (
        two(lower="link = {mass = 1, center_of_mass = [0, 0, 0], first_moments = [0, 0, 0]}"),
        r"joint 'lower': key 'link': first_moments and center_of_mass contradict",
    ),
    (
        two(lower='kind = "fixed"\nrated_speed = 1'),
        r"joint 'lower': a fixed joint has no rated_speed; remove the key",
    ),
    (two(lower='parent = "uper"'), r"'parent' = 'uper': there is no such joint; .*'upper'"),
    (two(upper='parent = "lower"'), r"joint 'upper': its parent 'lower' does not precede it"),
    (two(lower='friction = [{term = "visc"}]'), r"key 'friction.0.term' = 'visc'"),
    (two(top='friction = [{term = "viscous", gamma = 1}]'), r"'viscous' has no gamma; remove"),
    (two(top='friction = [{term = "stribeck"}]'), r"the term 'stribeck' needs its speed"),
    (
        two(lower='friction = ["viscos"]'),
        r"joint 'lower': key 'friction.0.term' = 'viscos': .*did you mean 'viscous'",
    ),
    (
        two(top='friction = [{term = "dahl", distanc = 1}]'),
        r"friction number 1: unknown key 'distanc'; did you mean 'distance'",
    ),
    (
        two(top='friction = [{term = "dahl", speed = 1, distance = 1}]'),
        r"the term 'dahl' has no speed; it has distance",
    ),
    (
        two(top='friction = [{term = "lugre", distance = 1}]'),
        r"'lugre' needs its excess.* and its speed .*\(excess, speed\)",
    ),
    (
        two(top='friction = [{term = "counterbalance", ratio = 2, angle = 0}]'),
        r"key 'friction': term 'counterbalance': strut_ratio must be in its range \(0.01 to 0.99\)",
    ),
    (
        two(lower='friction = ["coulomb", {term = "dahl", distance = 1}]'),
        r"joint 'lower': key 'friction': friction terms named twice: fc; 'dahl' and 'lugre' take",
    ),
    (
        two(top='friction = [{term = "maxwell_slip", distances = [1, 1]}]'),
        r"term 'maxwell_slip': slip distances must differ",
    ),
    (two(top='friction = [{term = "coulomb", gamma = 0}]'), r"key 'gamma' = 0: .*greater than 0"),
    (
        two(lower='friction = [{term = "coulomb"}, {term = "coulomb"}]'),
        r"joint 'lower': key 'friction': friction terms named twice: fc",
    ),
    (
        two(top='friction = [{term = "offset"}, {term = "asymmetric"}]'),
        r"key 'friction': asymmetric Coulomb friction .* already contains",
    ),
    (two(lower="nominal_friction = {fs = 1}"), r"joint 'lower': key 'nominal_friction': .* 'fs'"),
    (two(top='gravity = "down"'), r"key 'gravity' = 'down': gravity is one of none, -x"),
    (two(top="gravity = [0, 9.81]"), r"key 'gravity' = \[0, 9.81\]"),
    (two(top='units = "grad"'), r"key 'units' = 'grad'"),
    (two(end="[transmission]\nreduction = [1]"), r"reduction .*shape \(1, 1\); with 2 moving"),
    (two(end="[transmission]\nreduction = [1, 0]"), r"reduction of joint 'lower' is 0"),
    (two(end="[transmission]\nreduction_matrix = [[1, 0], [0]]"), r"not an array of numbers"),
    (
        two(end="[transmission]\nreduction = [1, 1]\nreduction_matrix = [[1, 0], [0, 1]]"),
        r"reduction and reduction_matrix are both given",
    ),
    (two(end="[transmission]\ndrive_gain = [1]"), r"drive_gain has shape \(1,\) for 2 moving"),
    (two(end="[transmission]\nposition_offset = [1]"), r"position_offset has shape \(1,\)"),
    (two(end="[transmission]\ngear = [1]"), r"unknown key 'transmission.gear'"),
    (two(end='[[couplings]]\nmotor = 3\njoint = "upper"'), r"no joint number 3; .* from 1 to 2"),
    (two(end='[[couplings]]\nmotor = "loer"\njoint = 1'), r"joint 'loer'; did you mean 'lower'"),
    (two(end="[[couplings]]\nmotor = 1\njoint = 1"), r"two different joints"),
    (two(end="[[couplings]]\nmotor = 1"), r"coupling number 1: key 'joint' is missing"),
    (
        two(end="[[couplings]]\nmotor = 2\njoint = 2\nreduction = 3"),
        r"element of the reduction matrix is already given",
    ),
    (two(end='[[couplings]]\nmotor = 2\njoint = 1\nparameters = ["ia"]'), r"parameters.0.* = 'ia'"),
    (two(lower="link = 3"), r"joint 'lower': link must be a table of keys, not 3"),
    (
        two(end="[[couplings]]\nmotor = 2\njoint = 1\nparameters = []\nnominal = {fvm = 1}"),
        r"coupling number 1: nominal fvm: not among the coupling's parameters \(none\)",
    ),
    (two(lower='name = "upper"').replace('name = "lower"\n', ""), r"used twice: upper"),
    ('name = "empty"\njoints = []', r"key 'joints' = \[\]"),
    ('name = "still"\n[[joints]]\nname = "a"\nkind = "fixed"', r"no moving joint"),
    ('name = "none"', r"key 'joints' is missing; add it"),
    ('name = "nameless"\n[[joints]]\nalpha = 1', r"joint number 1: key 'name' is missing"),
    ('name = "list"\njoints = [3]', r"joint number 1: this entry must be a table of keys, not 3"),
    ("name = two\n", r"is not TOML: .*line 1.*correct this line"),
]


@pytest.mark.parametrize(("text", "message"), WRONG, ids=[message for _, message in WRONG])
def test_a_wrong_file_is_refused_with_file_joint_key_and_value(text, message):
    with pytest.raises(RobotDescriptionError, match=message) as caught:
        parse_modified_dh(text, source="arm.toml")
    assert str(caught.value).startswith("arm.toml: ")
    assert "pydantic" not in str(caught.value)


def test_all_problems_of_a_file_are_told_at_once():
    with pytest.raises(RobotDescriptionError) as caught:
        parse_modified_dh(two(upper="alhpa = 1", lower="tetha = 1"))
    assert "alhpa" in str(caught.value) and "tetha" in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(RobotDescriptionError, match=r"no\.toml: cannot be read"):
        read_modified_dh(tmp_path / "no.toml")


def test_a_file_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "binary.toml"
    path.write_bytes(b"name = '\xff\xfe'")
    with pytest.raises(RobotDescriptionError, match="is not UTF-8 text"):
        read_modified_dh(path)
