"""TOML made to harm: endless keys, deep tables, numbers beyond all others, names as paths."""

import pytest

from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError, PividentError, RobotDescriptionError
from pivident.foundation.text.toml import MAX_PARTS, parse_toml
from pivident.robot.modified_dh import parse_modified_dh, read_modified_dh
from pivident.studies.many.study.scenario import load_scenario, read_scenario
from tests.faults.hostile import STUDY, written


@pytest.mark.parametrize(
    "text",
    [
        "a." * 100_000 + "a = 1",
        "[" + "a." * 100_000 + "a]",
        '"a b".' * 50_000 + "a = 1",
        "'a b' . " * 50_000 + "a = 1",
        "x = {" + "a." * 100_000 + "a = 1}",
    ],
)
def test_keys_of_many_parts_take_no_time_with_their_square(text):
    with pytest.raises(ValueError, match=f"more than {MAX_PARTS} parts"):
        parse_toml(text)


def test_keys_of_a_few_parts_are_read():
    text = "\n".join(f"{'.'.join('abcdefg')}{k} = [1.0, 2.0, 3.0, 4.0]" for k in range(3))
    dotted = ".".join("abcdefghijklmnop")
    assert parse_toml(f'{text}\nx = "{dotted}"')["x"] == dotted


@pytest.mark.parametrize("parse", [parse_modified_dh, lambda t: read_scenario(t, "s")])
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = " + "[" * 50_000, "nested too deeply"),
        ("a = " + "{a=" * 50_000, "nested too deeply"),
        ("a = " + "9" * 5000, "4300 digits"),
        ("a = 0x" + "f" * 5000, "beyond the 64 bits"),
        ("a = 1979-05-27", "unknown"),
        ("a = nan", "unknown"),
        ("".join(f"a{k} = 1\n" for k in range(3000)), "more"),
        ("a = 'x", "is not TOML"),
    ],
)
def test_toml_that_goes_on_and_on(parse, text, message):
    with pytest.raises(PividentError, match=message) as caught:
        parse(text)
    assert len(str(caught.value)) < 10_000


@pytest.mark.parametrize("value", ["9" * 400, "nan", "inf", "1979-05-27", "[[1]]"])
@pytest.mark.parametrize(
    "line",
    [
        "[controller]\ntype = 'pd'\nkp = {}\nkd = 1",
        "[identify]\nmask = {}",
        "[gains]\nknown_within = {}",
    ],
)
def test_numbers_that_are_none(tmp_path, line, value):
    path = written(tmp_path, "e.toml", f"robot = 'planar_2r'\n[recording]\nfiles = 'x'\n"
                   f"columns = {{q = 'q', tau = 'tau'}}\n{line.format(value)}\n")  # fmt: skip
    with pytest.raises(ExperimentError, match=r"key '(kp|mask|known_within)'"):
        load_experiment(path)


def test_a_name_of_megabytes_is_cut_in_the_message(tmp_path):
    path = written(tmp_path, "s.toml", STUDY.replace("planar_2r", "planar_" + "9" * 60_000))
    with pytest.raises(PividentError, match="gallery has no robot") as caught:
        load_scenario(path)
    assert len(str(caught.value)) < 3000


@pytest.mark.parametrize("reader", [read_modified_dh, load_experiment, load_scenario])
def test_logs_are_no_toml(tmp_path, reader):
    path = written(tmp_path, "a.toml", b"1,2\n" * 300_000)
    with pytest.raises(PividentError, match="too many"):
        reader(path)


def test_a_robot_of_thousands_of_joints():
    rows = "".join(f'[[joints]]\nname = "j{k}"\n' for k in range(5000))
    with pytest.raises(RobotDescriptionError, match="at most 1000"):
        parse_modified_dh(f'name = "x"\n{rows}')


def test_a_joint_numbered_with_thousands_of_digits(tmp_path):
    friction = f'joint_friction = {{{"9" * 5000} = ["viscous"]}}'
    path = written(tmp_path, "e.toml", f'[robot]\nmodel = "planar_2r"\n{friction}\n[recording]\n'
                   'files = "x"\ncolumns = {q = "q", tau = "tau"}\n')  # fmt: skip
    with pytest.raises(RobotDescriptionError, match="there is no joint number"):
        _ = load_experiment(path).robot


def test_a_scenario_of_a_billion_conditions():
    groups = "".join(
        f"[vary.g{g}]\n" + "".join(f"a{k} = {{}}\n" for k in range(9)) for g in range(9)
    )
    with pytest.raises(ExperimentError, match=r"gives 387420489 conditions, at most"):
        read_scenario(STUDY + groups, "s")


def test_scenarios_with_numbers_beyond_all_others():
    with pytest.raises(ExperimentError, match="whole number beyond the 64 bits"):
        read_scenario(f"seed = {'9' * 400}\n{STUDY}", "s")
    with pytest.raises(ExperimentError, match="more than 1,000,000,000 samples"):
        read_scenario(f"{STUDY}[record]\nrate = 1e300\n[trajectory]\nduration = 1e300\n", "s")
    with pytest.raises(ExperimentError, match="'runs' = 1000000000000"):
        read_scenario(f"runs = 1000000000000\n{STUDY}", "s")


@pytest.mark.parametrize(
    "name", ["../../x", "/etc/x", "..", "a/b", "a\\\\b", ".hidden", "\\u001b[2J", ""]
)
def test_conditions_are_no_paths(name):
    with pytest.raises(ExperimentError, match="names a folder of results"):
        read_scenario(f'{STUDY}[vary.g]\n"{name}" = {{}}\n', "s")


@pytest.mark.parametrize("folder", ["../elsewhere", "/tmp/x", "a/../../b", "a\\u001bb"])
def test_results_do_not_go_where_a_file_from_elsewhere_likes(tmp_path, folder):
    path = written(tmp_path, "e.toml", f"robot = 'planar_2r'\n[recording]\nfiles = 'x'\n"
                   f"columns = {{q = 'q', tau = 'tau'}}\n"
                   f"[output]\nfolder = \"{folder}\"\n")  # fmt: skip
    with pytest.raises(ExperimentError, match="beside or below this file"):
        load_experiment(path)
