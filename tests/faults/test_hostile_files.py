"""Files made to harm: bombs, endless and nested ones, code, devices, and names of other places."""

import gzip
import io
import json
import os
import pickle
import struct
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from pivident.audit.reading import bare_log
from pivident.errors import ExperimentError, FileFormatError, PividentError, RobotDescriptionError
from pivident.experiment import load_experiment
from pivident.recording.load import load_recording
from pivident.recording.read_npz import read_npz
from pivident.recording.tables import names_in, read_table
from pivident.recording.timestamps import uniform_grid
from pivident.robot import parse_modified_dh, parse_urdf, read_modified_dh, read_urdf
from pivident.robot.gallery import load_robot
from pivident.robot.urdf_xml import MAXIMUM_SIZE, MOST_ELEMENTS, MOST_LINKS
from pivident.study.scenario import load_scenario, read_scenario
from pivident.toml_text import MOST_PARTS, parse_toml

READERS = {
    "csv": read_table,
    "npz": read_table,
    "mat": read_table,
    "parquet": read_table,
    "urdf": read_urdf,
    "robot.toml": read_modified_dh,
    "experiment.toml": load_experiment,
    "study.toml": load_scenario,
}

EVERY = pytest.mark.parametrize("ending", READERS)

STUDY = """
robot = "planar_2r"
[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]
[noise]
torque = 0.05
"""


def written(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


# ------------------------------------------------------------------------------- what is no file


@EVERY
def test_a_pipe_is_not_waited_for(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    os.mkfifo(path)
    with pytest.raises(PividentError, match="a device or a pipe"):
        READERS[ending](path)


@EVERY
def test_a_device_is_not_read_for_ever(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    path.symlink_to("/dev/zero")
    with pytest.raises(PividentError, match="a device or a pipe"):
        READERS[ending](path)


@EVERY
def test_a_name_with_nul_is_refused(ending):
    with pytest.raises(PividentError, match="NUL"):
        READERS[ending](f"a\0b.{ending}")


@EVERY
def test_a_name_without_end_is_refused(ending):
    with pytest.raises(PividentError):
        READERS[ending](f"{'a' * 5000}.{ending}")


def test_a_robot_named_with_nul_in_an_experiment_is_refused(tmp_path):
    path = written(tmp_path, "e.toml", '[robot]\nmodel = "a\\u0000.urdf"\n[recording]\n'
                   'files = "x"\ncolumns = {q = "q", tau = "tau"}\n')  # fmt: skip
    with pytest.raises(RobotDescriptionError, match="NUL"):
        _ = load_experiment(path).robot


# ------------------------------------------------------------------------------------------ XML


@pytest.mark.parametrize(
    "declaration",
    [
        '<!DOCTYPE r SYSTEM "file:///etc/passwd">',
        '<!DOCTYPE r PUBLIC "a" "http://localhost:9/x">',
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE r [<!ENTITY % x SYSTEM "http://localhost:9/x"> %x;]>',
        '<!DOCTYPE r [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
        "<!DOCTYPE r ["
        + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 30))
        + "]>",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_no_document_type_is_followed(declaration, encoding):
    head = f'<?xml version="1.0" encoding="{encoding}"?>'
    with pytest.raises(RobotDescriptionError, match="document type declaration"):
        parse_urdf(f'{head}{declaration}<robot name="&a;"/>'.encode(encoding))


def test_an_entity_that_nobody_declared():
    with pytest.raises(RobotDescriptionError, match="is not XML"):
        parse_urdf('<robot name="&xxe;"/>')


LINKS = '<link name="a"/><link name="b"/>'
ENDS = '<parent link="a"/><child link="b"/>'


@pytest.mark.parametrize("length", ["1e308", "1e200", "3e-9"])
def test_an_axis_of_any_length_is_a_direction(length):
    """Its square would be infinite, and the direction nought."""
    axis = f'<axis xyz="{length} {length} 0"/>'
    joint = f'<joint name="j" type="revolute">{ENDS}{axis}</joint>'
    robot = parse_urdf(f'<robot name="r">{LINKS}{joint}</robot>')
    z = robot.joints[0].rotation[:, 2]
    np.testing.assert_allclose(z, [np.sqrt(0.5), np.sqrt(0.5), 0.0], atol=1e-15)


def test_a_value_of_megabytes_is_not_repeated():
    joint = f'<joint name="j" type="{"x" * 10**6}">{ENDS}</joint>'
    with pytest.raises(RobotDescriptionError, match="does not exist") as caught:
        parse_urdf(f'<robot name="r">{LINKS}{joint}</robot>')
    assert len(str(caught.value)) < 3000


def test_inclusions_are_passed_over(tmp_path):
    text = """<robot name="r" xmlns:xi="http://www.w3.org/2001/XInclude">
    <xi:include href="/etc/passwd" parse="text"/><link name="a"/><link name="b"/>
    <joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint></robot>"""
    assert "root:" not in repr(parse_urdf(text))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"<robot>" + b"<a/>" * (MOST_ELEMENTS + 1) + b"</robot>", "more than .* elements"),
        (b"<robot>" + b"<a>" * 50_000, "is not XML"),
        (b"<robot>" + b" " * MAXIMUM_SIZE + b"</robot>", "larger than"),
        (
            b"<robot>%s</robot>" % b"".join(b'<link name="%d"/>' % k for k in range(1001)),
            f"{MOST_LINKS} can be read",
        ),
    ],
)  # fmt: skip
def test_packed_urdf_bombs(tmp_path, content, message):
    path = written(tmp_path, "a.urdf.gz", gzip.compress(content, 1))
    assert path.stat().st_size < 200_000
    with pytest.raises(RobotDescriptionError, match=message):
        read_urdf(path)


# ----------------------------------------------------------------------------------------- TOML


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
    with pytest.raises(ValueError, match=f"more than {MOST_PARTS} parts"):
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
    with pytest.raises(ExperimentError, match=r"makes 387420489 conditions, at most"):
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


# ------------------------------------------------------------------------------------------ CSV


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (",".join(map(str, range(10**6))), "columns|characters"),
        ("a," * 20_000 + "b\n" + "1," * 20_000 + "1\n", "more than 10000 columns"),
        (b"1" * 3_000_000, "first line of"),
        ('a,b\n1,2\n"3,' + "4,5\n" * 100_000, "line|table"),
        ('"a,b\n' + "1,2\n" * 10, "no samples|a,b|cells|table"),
        (f"a,b\n1,{'x' * 200_000}\n", "is not a number"),
        (f'a,b\n1,"{"x" * 200_000}\n', "line 2|table"),
        (f"{'a' * 1000},b\n1,2\n", "1000 characters"),
        ("a\x1b[2J,b\n1,2\n", "control characters"),
        ("a,b\n1,\0\n", "not a number|binary"),
        (b"a,b\n1,\xff\xfe\n", "not a number"),
        ("a,a\n1,2\n", "more than one column"),
        ("a,b\n1,2\n3\n", "1 cells instead of 2"),
    ],
)
def test_tables_that_are_none(tmp_path, content, message):
    with pytest.raises(FileFormatError, match=message) as caught:
        read_table(written(tmp_path, "a.csv", content))
    assert len(str(caught.value)) < 1000


def test_a_byte_order_mark_is_no_part_of_a_name(tmp_path):
    assert names_in(written(tmp_path, "a.csv", "\ufeffa,b\n1,2\n")) == ("a", "b")


def test_formulas_are_names_and_no_numbers(tmp_path):
    path = written(tmp_path, "a.csv", "=cmd|' /C calc'!A0,b\n1,2\n")
    assert list(read_table(path)) == ["=cmd|' /C calc'!A0", "b"]
    with pytest.raises(FileFormatError, match="not a number"):
        read_table(written(tmp_path, "b.csv", "a,b\n=1+1,2\n"))


@pytest.mark.parametrize("reader", [read_table, bare_log])
def test_a_packed_table_that_grows_out_of_proportion(tmp_path, monkeypatch, reader):
    monkeypatch.setattr("pivident.recording.read_csv.HARMLESS_SIZE", 2**20)
    monkeypatch.setattr("pivident.recording.files.HARMLESS_SIZE", 2**20)
    path = written(tmp_path, "a.csv.gz", gzip.compress(b"a,b\n" + b"1,\n" * 10_000_000))
    with pytest.raises(FileFormatError, match="expands from"):
        reader(path)


# ------------------------------------------------------------------------------ arrays and tables


class Harm:
    """What a pickle could do when it is loaded."""

    def __reduce__(self):
        return os.mkdir, ("harmed",)


def npy(header: bytes, body: bytes = b"", version=(1, 0)) -> bytes:
    length = struct.pack("<H" if version == (1, 0) else "<I", len(header))
    return b"\x93NUMPY" + bytes(version) + length + header + body


def archive(tmp_path, **members):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name.replace("__", "/") + ".npy", content)
    return path


def test_pickled_arrays_are_never_loaded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    header = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }\n"
    path = archive(tmp_path, x=npy(header, pickle.dumps([Harm()])))
    for reading in (lambda: read_table(path), lambda: read_npz(path, ["x"])):
        try:
            assert reading() == {}
        except FileFormatError as error:
            assert "pickled objects" in str(error)
    bare = written(tmp_path, "b.npz", pickle.dumps(Harm()))
    with pytest.raises(FileFormatError, match=r"not an \.npz archive"):
        read_table(bare)
    assert not (tmp_path / "harmed").exists()


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999,), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (True, 3), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (" + b"9" * 5000 + b",), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': ((((3,),),),), }\n",
        b"{'descr': __import__('os').system('true'), 'fortran_order': False, 'shape': (3,), }\n",
        b"(" * 5000,
        b"{" * 9000,
        b"-" * 9000 + b"1",
        b"'" * 3,
        b"\xff\xfe\n",
    ],
)
@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0), (9, 9)])
def test_headers_of_arrays_that_lie(tmp_path, header, version):
    path = archive(tmp_path, x=npy(header, bytes(24), version))
    with pytest.raises(FileFormatError, match=r"array 'x'"):
        read_table(path)


def test_a_header_of_a_gigabyte_is_not_unpacked(tmp_path):
    """NumPy reads a header of any length before it looks at it."""
    content = b"\x93NUMPY" + bytes((2, 0)) + struct.pack("<I", 2**30) + bytes(2**22)
    path = archive(tmp_path, x=content)
    with pytest.raises(FileFormatError, match="header has 1073741824 bytes"):
        read_table(path)


def test_names_in_archives_are_no_paths(tmp_path, monkeypatch):
    """Members are read, never unpacked to disk, whatever they are called."""
    monkeypatch.chdir(tmp_path)
    stream = io.BytesIO()
    np.save(stream, np.arange(3.0))
    path = archive(tmp_path, **{"..__..__evil": stream.getvalue(), "__abs": stream.getvalue()})
    assert set(read_table(path)) == {"../../evil", "/abs"}
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_encrypted_and_unknown_members(tmp_path):
    stream = io.BytesIO()
    np.savez(stream, x=np.arange(3.0))
    whole = bytearray(stream.getvalue())
    central = whole.rindex(b"PK\x01\x02")
    for offset, value in ((8, 1), (10, 99)):  # flag: encrypted; method: unknown
        content = bytearray(whole)
        content[central + offset] = value
        content[6 if offset == 8 else 8] = value
        with pytest.raises(FileFormatError, match="array 'x' is damaged"):
            read_table(written(tmp_path, "a.npz", bytes(content)))


def test_objects_of_matlab_files_are_not_made(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "a.mat"
    savemat(path, {"o": np.array([{"a": 1}], dtype=object), "x": [[1.0, 2.0]]})
    assert list(read_table(path)) == ["x"]


def test_parquet_with_nested_and_other_types(tmp_path):
    from datetime import date

    import polars as pl

    path = tmp_path / "a.parquet"
    content = {
        "x": [1.0],
        "n": [{"a": {"b": [1]}}],
        "l": [[1.0] * 1000],
        "d": [date(2020, 1, 1)],
        "s": ["="],
    }
    pl.DataFrame(content).write_parquet(path)
    assert list(read_table(path)) == ["x"]
    pl.DataFrame({f"c{k}": [1.0] for k in range(2000)}).write_parquet(path)
    assert len(read_table(path)) == 2000


def test_parquet_that_makes_its_library_panic(tmp_path):
    """Whatever the metadata says, the library's panic is no Python error that passes."""
    import polars as pl

    path = tmp_path / "a.parquet"
    pl.DataFrame({"x": [1.0, 2.0]}).write_parquet(path)
    whole = path.read_bytes()
    size = struct.unpack("<I", whole[-8:-4])[0]
    for k in range(0, size, 3):
        at = len(whole) - 8 - size + k
        path.write_bytes(whole[:at] + b"\xff\xff" + whole[at + 2 :])
        try:
            read_table(path)
        except PividentError:
            continue


# ----------------------------------------------------------------------------------------- JSON


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, "3", "null", "[]", '{"layout": 1}', '{"layout": 1, "hash": 3}', "{", "\x00",
     '{"layout": 1, "programs": 3}', '{"scenario": []}'],
)  # fmt: skip
def test_manifests_that_are_none(tmp_path, text):
    from pivident.study.errors import StudyFolderError
    from pivident.study.store import MANIFEST, Store

    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(StudyFolderError, match=r"manifest\.json"):
        with Store(tmp_path).opened(read_scenario(STUDY, "s"), 6):
            pass
    assert (tmp_path / MANIFEST).read_text() == text


def test_a_broken_trajectory_is_named(tmp_path):
    from pivident.study.errors import StudyFolderError
    from pivident.study.motion import FILE, optimised_series

    scenario = read_scenario(f'{STUDY}[trajectory]\ntype = "fourier"\n', "s")
    for text in ("{", "[" * 100_000, "[]", "{}", '{"belongs_to": 1'):
        (tmp_path / FILE).write_text(text)
        with pytest.raises(StudyFolderError, match="delete it: it is made again"):
            optimised_series(scenario, tmp_path)


# ---------------------------------------------------------------------------------- experiments

LOG = "time,q1,q2,tau1,tau2\n" + "".join(
    f"{k / 1000},{np.sin(k):.5f},{np.cos(k):.5f},{np.sin(2 * k):.5f},{np.cos(3 * k):.5f}\n"
    for k in range(60)
)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("resample = true\nrate = 1e300", "samples of 60, more than"),
        ("resample = true\nrate = 1e10", "samples of 60, more than"),
        ("part = [5.0, 1e308]", "no sample of recording"),
        ("part = [-1e308, -1e307]", "no sample of recording"),
        ('side = {q = ["motor"]}', "choose joint or motor"),
        ("units = {q = 1e400}", "number other than 0"),
        (f"units = {{q = {'9' * 400}}}", "beyond the 64 bits"),
        ("units = {t = 1979-05-27}", "is not known here"),
        ("position_offset = [1e308, 1e308]", "far beyond its limits"),
    ],
)
def test_recordings_that_cannot_be(tmp_path, more, message):
    written(tmp_path, "log.csv", LOG)
    columns = 'columns = {t = "time", q = ["q1", "q2"], tau = ["tau1", "tau2"]}'
    path = written(tmp_path, "e.toml", f'robot = "planar_2r"\n[recording]\nfiles = "log.csv"\n'
                   f"{columns}\n{more}\n")  # fmt: skip
    with pytest.raises(PividentError, match=message):
        load_experiment(path).recordings()


def test_one_stamp_far_away_does_not_fill_the_memory():
    """A grid at the rate of the others would have 10^15 samples."""
    t = np.append(np.arange(100) / 1000.0, 1e12)
    with pytest.raises(PividentError, match="samples of 101, more than"):
        uniform_grid(t)


@pytest.mark.parametrize("spec", [{"file": ["a"], "columns": "q1"}, {"file": {}, "columns": "q1"}])
def test_files_that_are_no_names(tmp_path, spec):
    path = written(tmp_path, "log.csv", LOG)
    with pytest.raises(PividentError, match="the file of q is named"):
        load_recording(path, {"t": "time", "q": spec, "tau": ["tau1", "tau2"]})


# --------------------------------------------------------------------------------------- memory


def test_bombs_stay_within_half_a_gigabyte(tmp_path):
    """In a process that may not have more, each bomb is refused by name."""
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (2000000000,), }\n"
    archive(tmp_path, x=npy(header, bytes(2**20)))
    written(tmp_path, "a.urdf.gz", gzip.compress(b"<robot>" + bytes(10**8), 1))
    written(tmp_path, "a.toml", b"a" * 2**21)
    code = f"""
import os, resource, sys
from pivident.errors import PividentError
from pivident.recording.tables import read_table
from pivident.robot import load_robot
import numpy
pages = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (pages + 2**28, -1))
for read, name in ((read_table, "a.npz"), (load_robot, "a.urdf.gz"), (load_robot, "a.toml")):
    try:
        read(os.path.join({str(tmp_path)!r}, name))
    except PividentError as error:
        print(name)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split() == ["a.npz", "a.urdf.gz", "a.toml"], done.stderr


def test_gallery_names_are_no_paths():
    for name in ("../../../etc/passwd", "/etc/passwd", "staubli_tx40\0", "..", "a b; rm -rf ."):
        with pytest.raises(RobotDescriptionError):
            load_robot(name)


def test_what_is_read_comes_back_whole(tmp_path):
    """The bounds above do not touch an honest file."""
    path = tmp_path / "a.npz"
    np.savez_compressed(path, q=np.zeros((1_000_00, 6)))
    assert read_table(path)["q"].shape == (100_000, 6)
    assert json.dumps(names_in(path)) == '["q"]'
