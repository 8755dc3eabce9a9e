"""An edit changes one value and its comment; every other byte stays."""

import copy

import pytest
from hypothesis import given, settings, strategies as st

from pivident.app.studio.rows import experiment_rows
from pivident.experiment.edited_file import confirmed, edited, with_repair
from pivident.experiment.explained import plain_form
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.repair import Repair, Reversed
from pivident.foundation.text.toml import parse_toml
from tests.conftest import REPOSITORY
from tests.planar_log import EXPERIMENT

COMMENTS = ("", "# a word\n", "# ASSUMED, please check: seen, it is. Or else.\n", "\n# x\n\n")
VALUES = {
    ("recording", "delay"): ("0.5", "-1e-3", "0.25"),
    ("recording", "side"): ('"motor"', "'joint'", '{q = "joint", tau = "motor"}'),
    ("recording", "part"): ("[0.0, 1.0]", "[\n  0.0, # begin\n  2.0,\n]", "[3, 4]"),
    ("recording", "name"): ('"run # 1"', '"""two\nlines"""', '"[[x]]"', "'''a'b'''"),
    ("recording", "units", "q"): ('"deg"', '"rad"', '["deg", "rad"]'),
    ("recording", "units", "tau"): ('{unit = "A", gain = 2.0}', "-1.0", '"N m"'),
    ("validation", "folds"): ("3", "0", "7"),
    ("identify", "piv", "tolerance"): ("0.1", "1e-4", "0.5"),
    ("identify", "mask"): ('"auto"', "0.01", "0.02"),
}

ROBOTS = (
    'robot = "arm"\n', '[robot]\nmodel = "arm"\n', 'robot = {model = "arm"}\n',
    'robot.model = "arm"\n',
)  # fmt: skip


@st.composite
def files(draw):
    """A file in any of the forms that TOML has for it, and what it says of each key."""
    end = draw(st.sampled_from(["\n", "\r\n"]))
    chosen = {place: draw(st.sampled_from(own)) for place, own in VALUES.items()
              if draw(st.booleans())}  # fmt: skip
    runs = draw(st.sampled_from(["[recording]", "[[recording]]", "[[recording]] twice"]))

    def lines(table, inline):
        own = {p[-1]: v for p, v in chosen.items() if p[:-1] == table}
        if inline:
            flat = {k: v for k, v in own.items() if "\n" not in v}
            return flat and "{" + ", ".join(f"{k} = {v}" for k, v in flat.items()) + "}"
        written = [
            f"{draw(st.sampled_from(COMMENTS))}{k}={draw(st.sampled_from(['', ' ']))}{v}"
            f"{draw(st.sampled_from(['', '  # behind']))}\n"
            for k, v in own.items()
        ]
        return "".join(written)

    robot = draw(st.sampled_from(ROBOTS))
    head = "[[recording]]" if "[[" in runs else "[recording]"
    text = f'# file\n{robot}\n{head}\nfiles = "log.csv"\ncolumns = {{q = ["a"], tau = ["b"]}}\n'
    text += lines(("recording",), False)
    form = draw(st.sampled_from(["inline", "table", "dotted"]))
    units = lines(("recording", "units"), form == "inline")
    if form == "inline" and units:
        text += f"units = {units}\n"
    elif form == "dotted":
        text += "".join(f"units.{p[-1]} = {v}\n" for p, v in chosen.items()
                        if p[:-1] == ("recording", "units"))  # fmt: skip
    elif units:
        text += f"\n  [recording.units]\n{units}"
    if "twice" in runs:
        text += '\n[[recording]]\nfiles = "b.csv"\ncolumns = {q = ["a"], tau = ["b"]}\n'
    for table in (("validation",), ("identify",), ("identify", "piv")):
        own = lines(table, False)
        text += f"\n[{'.'.join(table)}]\n{own}" if own else ""
    return text.replace("\n", end)


def with_value(text, place, value):
    return edited(text, [(place, value)])


def without(text, place):
    return edited(text, [(place, None)])


def numbered(place):
    return ("recording", 0, *place[1:]) if place[0] == "recording" else place


def content(text):
    return plain_form(parse_toml(text))


def at(tables, place):
    for part in place:
        tables = tables[part]
    return tables


def kept_lines(text):
    """Lines that are no comments of an edit."""
    return [line for line in text.split("\n")
            if not line.startswith(("# Set by hand.", "# Removed by hand."))]  # fmt: skip


@settings(max_examples=60)
@given(files(), st.sampled_from(sorted(VALUES)), st.data())
def test_nothing_else_changes(text, place, data):
    value = data.draw(st.sampled_from(VALUES[place]))
    place = numbered(place)
    new = with_value(text, place, value)
    before, after = content(text), content(new)
    assert at(after, place) == parse_toml(f"x = {value}")["x"]
    # the rest, by the parser
    rows = {row.place: row.value for row in experiment_rows(text)}
    others = {p: v for p, v in {r.place: r.value for r in experiment_rows(new)}.items()
              if p != place and p[: len(place)] != place}  # fmt: skip
    assert others == {p: v for p, v in rows.items() if p != place and p[: len(place)] != place}
    assert set(before) <= set(after)
    assert ("\r\n" in new) == ("\r\n" in text) and new.count("\r") == (
        new.count("\n") if "\r" in text else 0
    )
    # the bytes: without the value and comments of edits, the old text is what is left of the new
    if place in rows and rows[place] != value and "\n" not in value + rows[place]:
        old_lines, new_lines = kept_lines(text), kept_lines(new)
        reason = [k for k in old_lines if k.startswith("# ASSUMED")]
        gone = len(old_lines) - len(new_lines)
        assert gone in (0, 1) and gone <= len(reason)
        differing = [k for k in new_lines if k not in old_lines]
        assert len(differing) <= 1
    assert with_value(new, place, value) == new


@settings(max_examples=60)
@given(files(), st.data())
def test_a_key_is_removed_and_comes_back(text, data):
    rows = [row for row in experiment_rows(text) if row.place[-1] not in ("files", "model", "q")
            and "columns" not in row.place]  # fmt: skip
    if not rows:
        return
    row = data.draw(st.sampled_from(rows))
    new = without(text, row.place)
    expected = copy.deepcopy(content(text))
    at(expected, row.place[:-1]).pop(row.place[-1])
    lonely = copy.deepcopy(expected)  # dotted keys take their table along
    if at(lonely, row.place[:-1]) == {}:
        at(lonely, row.place[:-2]).pop(row.place[-2])
    assert content(new) in (expected, lonely)
    assert content(with_value(new, row.place, row.value)) == content(text)


def test_the_comment_says_what_was_there():
    text = (
        '[recording]\n# likely: as the name says. In Hz.\nrate = 5.0\n# my word\nside = "joint"\n'
    )
    text = 'robot = "arm"\n' + text + 'files = "a.csv"\ncolumns = {q = "q"}\n'
    new = with_value(text, ("recording", 0, "rate"), "7.0")
    comment = "# Set by hand. Before: 5.0 (likely: as the name says. In Hz).\nrate = 7.0\n"
    assert comment in new
    again = with_value(new, ("recording", 0, "rate"), "8.0")
    assert again == new.replace("7.0", "8.0")  # what init had seen stays
    new = with_value(text, ("recording", 0, "side"), '"motor"')
    assert '# my word\n# Set by hand. Before: "joint".\nside = "motor"\n' in new
    new = with_value(text, ("recording", 0, "columns", "q"), '"p"')
    assert '# Set by hand. Before: q: "q".\ncolumns = {q = "p"}' in new


def test_a_suggestion_is_accepted():
    text = EXPERIMENT.split("[controller]")[0] + (
        '# [controller]\n# The law of the cabinet.\n# type = "identify"\n\n'
        "[output]\ntitle = 'x'\n"
    )
    new = with_value(text, ("controller", "type"), '"identify"')
    assert (
        "\n[controller]\n# Set by hand. Before: not set (The law of the cabinet).\ntype = " in new
    )
    assert new.endswith("\n\n[output]\ntitle = 'x'\n")


def test_short_forms():
    new = with_value(EXPERIMENT, ("robot", "gravity"), '"-x"')
    assert 'robot = {model = "planar_2r", gravity = "-x"}\n' in new
    assert 'robot = "arm.urdf"\n' in with_value(EXPERIMENT, ("robot", "model"), '"arm.urdf"')


def test_tables_are_removed():
    assert without(EXPERIMENT, ("controller",)) == EXPERIMENT.replace(
        EXPERIMENT[EXPERIMENT.index("[controller]") : EXPERIMENT.index("[identify]")], ""
    )
    second = "[[recording]]\nfiles = 'b.csv'\ncolumns = {q = 'q'}\n[recording.units]\nq = 'deg'\n"
    text = "robot = 'arm'\n[[recording]]\nfiles = 'a.csv'\ncolumns = {q = 'q'}\n"
    assert without(text + second, ("recording", 1)) == text


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (("recording", 0, "side2"), "1", r"\[recording\] unknown key 'side2'"),
        (("recording", 0, "rate"), "-1.0", r"\[recording\] key 'rate' = -1.0.*greater than 0"),
        (("recording", 0, "rate"), "fast", "rate: fast is not a value of TOML.*quotation marks"),
        (("recording", 0, "rate"), "1.0\n[robot]", "more than one value"),
        (("recording", 0, "rate"), "1.0 # x", "more than one value"),
        (("recording", 3, "rate"), "1.0", "rate has no table to stand in"),
        (("validation", "folds"), "1", r"\[validation\] folds = 1 leaves nothing to fit"),
    ],
)
def test_what_is_refused(place, value, words):
    with pytest.raises(ExperimentError, match=words):
        with_value(EXPERIMENT, place, value)


def test_what_cannot_be_removed():
    with pytest.raises(ExperimentError, match="needs kp"):
        without(EXPERIMENT, ("controller", "kp"))
    with pytest.raises(ExperimentError, match="not in the file; reload"):
        without(EXPERIMENT, ("recording", 0, "rate"))
    with pytest.raises(ExperimentError, match="is not TOML"):
        without("x = ", ("x",))


def test_one_of_two_faults_can_be_corrected():
    text = EXPERIMENT.replace("[recording]", "[recording]\nrates = 3\nside2 = 1")
    new = without(text, ("recording", 0, "rates"))
    assert "# rates = 3\n" in new and "\nside2 = 1\n" in new


def test_an_assumption_that_somebody_has_found_right():
    place = ("recording", 0, "units", "tau")
    text = (
        'robot = "arm"\n\n[recording]\nfiles = "log.csv"\n'
        "[recording.units]\n# ASSUMED, please check: the masses of the file. Or else.\n"
        'tau = [{unit = "A", gain = 2.0, scale = "assumed"}, {unit = "A", gain = 3.0}]  # drives\n'
        "# likely: seen.\nq = 'deg'\n"
    )
    new = confirmed(text, place)
    assert new == text.replace(
        "# ASSUMED, please check: the masses of the file. Or else.\n",
        "# Confirmed by hand (ASSUMED, please check: the masses of the file. Or else).\n",
    ).replace(', scale = "assumed"', "")
    (row,) = [row for row in experiment_rows(new) if row.place == place]
    assert row.sure == "given" and "the masses of the file" in row.reason
    for other in (place, ("recording", 0, "units", "q"), ("recording", 0, "units", "t")):
        with pytest.raises(ExperimentError, match="no assumption"):
            confirmed(new, other)


def test_the_last_dotted_key_takes_its_table_along():
    text = 'robot = "arm"\n[recording]\nfiles = "log.csv"\nunits.tau = {unit = "A", gain = 2.0}\n'
    new = without(text, ("recording", 0, "units", "tau"))
    assert parse_toml(new) == {"robot": "arm", "recording": {"files": "log.csv"}}
    assert '# units.tau = {unit = "A", gain = 2.0}' in new


SUB_TABLE = """\
robot = "arm"

[recording]
files = "log.csv"
columns = {q = ["a", "b"], tau = ["c", "d"]}

[recording.units]
q = "deg"   # as logged

# the drive
[recording.units.tau]
unit = "V"
gain = 35.15   # of the data sheet

[validation]
folds = 4
"""


def test_a_table_with_a_header_is_changed_key_by_key():
    """Also where the new value is given as a whole."""
    text = SUB_TABLE.replace("\n", "\r\n")
    for place, value in (
        (("recording", 0, "units", "tau"), '{unit = "V", gain = -35.15}'),
        (("recording", 0, "units", "tau", "gain"), "-35.15"),
    ):
        changed = "# Set by hand. Before: 35.15.\r\ngain = -35.15   # of"
        assert with_value(text, place, value) == text.replace("gain = 35.15   # of", changed)


def test_a_table_with_a_header_becomes_a_list():
    """Its comment says what it was; the rest of the file stays."""
    units = [{"unit": "V", "gain": -35.15}, {"unit": "V", "gain": 35.15}]
    value = '[{unit = "V", gain = -35.15}, {unit = "V", gain = 35.15}]'
    alone = SUB_TABLE.replace('[recording.units]\nq = "deg"   # as logged\n', "")
    for text, line in ((SUB_TABLE, f"tau = {value}"), (alone, f"units = {{tau = {value}}}")):
        new = with_value(text, ("recording", 0, "units", "tau"), value)
        assert parse_toml(new)["recording"]["units"]["tau"] == units
        assert f'# Set by hand. Before: {{unit = "V", gain = 35.15}}.\n{line}\n' in new
        table = text[text.index("[recording.units.tau]") : text.index("[validation]")]
        assert set(text.replace(table, "").splitlines()) < set(new.splitlines())


def test_tables_of_a_list_are_changed_one_by_one():
    text = SUB_TABLE.replace("[recording.units.tau]", "[[recording.units.tau]]").replace(
        "\n[validation]", '\n[[recording.units.tau]]\nunit = "A"\ngain = 2.0\n\n[validation]'
    )
    value = '[{unit = "V", gain = 35.15}, {unit = "A", gain = -2.0}]'
    new = with_value(text, ("recording", 0, "units", "tau"), value)
    assert new == text.replace("gain = 2.0", "# Set by hand. Before: 2.0.\ngain = -2.0")
    one = with_value(text, ("recording", 0, "units", "tau"), '"N m"')
    assert parse_toml(one)["recording"]["units"] == {"q": "deg", "tau": "N m"}


def test_a_repair_reverses_the_unit_of_such_a_table():
    repair = Repair((Reversed(channel="tau", joints=("one",)),))
    new, words = with_repair(SUB_TABLE, repair, ("one",))
    assert words == "Reverse the sign of the torque of one."
    assert parse_toml(new)["recording"]["units"]["tau"] == {"unit": "V", "gain": -35.15}


def test_tables_of_a_list_with_others_between_are_left_alone():
    """`tomlkit` would write them together."""
    first = "robot = 'arm'\n[[recording]]\nfiles = 'a.csv'\n"
    rest = "[[recording]]\nfiles = 'b.csv'\n"
    text = f"{first}[validation]\nfolds = 3\n{rest}"
    with pytest.raises(ExperimentError, match=r"cannot be changed here.*others between.*as text"):
        with_value(text, ("validation", "folds"), "4")
    together = f"{first}{rest}[validation]\nfolds = 3\n"
    assert "folds = 4" in with_value(together, ("validation", "folds"), "4")


@pytest.mark.parametrize("path", sorted(REPOSITORY.glob("examples/*/*.toml")), ids=str)
def test_examples_say_what_they_said_with_the_value_at_its_place(path):
    """Every key is removed, taken back and changed."""
    text = path.read_text("utf-8")
    if "[recording" not in text and "\nrecording" not in text:
        pytest.skip("a robot or a table of friction")
    for row in experiment_rows(text):
        try:
            new = without(text, row.place)
        except ExperimentError as error:  # what the file cannot do without, a law for its reference
            assert "cannot be changed" not in str(error) or "\nreference = " in text
            continue
        expected = copy.deepcopy(content(text))
        at(expected, row.place[:-1]).pop(row.place[-1])
        assert content(new) == expected
        assert content(with_value(new, row.place, row.value)) == content(text)
        try:
            new = with_value(text, row.place, row.example)
        except ExperimentError as error:
            assert "cannot be changed" not in str(error)
            continue
        at(expected, row.place[:-1])[row.place[-1]] = parse_toml(f"x = {row.example}")["x"]
        assert content(new) == expected
        assert [k for k in kept_lines(new) if k.startswith("[")] == [
            k for k in kept_lines(text) if k.startswith("[")
        ]
