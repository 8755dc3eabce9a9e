"""Whole files to begin with, and grammars that grow new ones, for each format."""

from __future__ import annotations

import gzip
import io
import json
import random
import tempfile
from datetime import date
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from fuzzing.mutations import NUMBERS, TEXTS

LOG = "time,q1,q2,r1,r2,tau1,tau2"


@cache
def log_table(samples: int = 60) -> np.ndarray:
    """A short log: time, two positions, two references, two torques."""
    t = np.arange(samples) / 1000.0
    waves = [np.sin((3 + k) * 20 * t + k) for k in range(6)]
    return np.column_stack([t, *waves])


def log_csv() -> bytes:
    """The log as CSV."""
    stream = io.StringIO()
    np.savetxt(stream, log_table(), fmt="%.6g", delimiter=",", header=LOG, comments="")
    return stream.getvalue().encode()


# ---------------------------------------------------------------------------------------- TOML

TOML_CHUNKS = (
    "\n[[joints]]\n", "\n[recording]\n", "\n[[recording]]\n", "\n[identify]\n", "\n[output]\n",
    "\n[controller]\n", "\n[robot]\n", "\n[validation]\n", "\n[gains]\n", "\n[vary]\n",
    "a.b.c.d.e = 1\n", "= 1979-05-27T07:32:00Z\n", "= 07:32:00\n", "= 1979-05-27\n", "= [[[[]]]]\n",
    "= " + "[" * 3000 + "\n", "= " + "{a=" * 2000 + "\n", "[" + "a." * 3000 + "a]\n",
    '"" = 1\n', '"\\u0000" = 1\n', "= '''", '= """', "= {}", "= nan", "= inf", "= " + "9" * 5000,
    "= true", "= []", '= ""', "= [1, 'a', 1.0, {}]", "= -1", "= 1e400", "= 0", "= 1e-300",
    'side = "motor"\n', "rate = 1e300\n", "resample = true\n", "samples_axis = 1\n",
    "part = [0, 1]\n", "part = [-1e308, 1e308]\n",
    'folder = "../../x"\n', 'model = "/dev/zero"\n', 'files = "/dev/zero"\n', "friction = []\n",
    "methods = []\n", "frozen = {a = 1.0}\n", "position_offset = [1.0, 2.0]\n",
    "torque_timing = 3\n",
)  # fmt: skip

EXPERIMENT = b"""
robot = "planar_2r"

[recording]
files = "log.csv"
columns = {t = "time", q = ["q1", "q2"], q_ref = ["r1", "r2"], tau = ["tau1", "tau2"]}
units = {q = "deg", q_ref = "deg", tau = {unit = "A", gain = 2.5}}
part = [0.0, 0.05]
torque_timing = "held"

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]
limit = 100.0

[identify]
methods = ["ls", "piv"]
mask = 0.05
bandpass = {cutoff = 50.0, decimation = [2, 3]}
random_walk = {order = 3}
piv = {noise = {criterion = "bic", p_max = 20}}

[validation]
folds = 3

[output]
folder = "results"
title = "a title"
"""

EXPERIMENT_2 = b"""
[robot]
model = "planar_2r"
gravity = "-y"
friction = ["viscous", {term = "coulomb", smoothing = "tanh"}, "offset"]
joint_friction = {"2" = ["viscous"]}
extra_friction = {"1" = [{term = "stribeck", speed = 0.1}]}
rotor_inertia = [0.1, 0.2]
reduction = {"1" = 50.0}
drive_gain = [1.0, 2.0]
couplings = [{motor = 2, joint = 1, ratio = 1.0}]

[[recording]]
files = {q = "log.csv", tau = "log.csv"}
columns = {t = {file = "q", columns = "time"}, q = ["q1", "q2"], tau = ["tau1", "tau2"]}
units = {q = {unit = "counts", per_revolution = 4096}, t = "ms", tau = ["V", "V"]}
side = {q = "motor", tau = "joint"}
resample = true
position_offset = [0.1, 0.2]
control_rate = 4000.0
saturation = "allow"

[gains]
trusted = {"1" = 2.0}
"""

STUDY = b"""
runs = 6
seed = 7
robot = "planar_2r"

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]

[record]
rate = 500

[trajectory]
duration = 2.0
seed = 2
reach = 1.5

[noise]
encoder = 2e-6
torque = 0.05

[start]
inertia = 1.1
spread = 0.1
count = 2

[identify]
methods = ["ls", "iv-full-rate"]

[vary.noise]
low = {noise = {torque = 0.01}}
high = {noise = {torque = 0.5}}
"""


BOUNDS = b"""
[consistency]
prior = "euclidean"
margin = 0.01
total_mass = [3.0, 20.0]

[consistency.bounds.forearm]
mass = [1.0, 9.0]
center_of_mass = [[-0.1, 0.9], [-0.2, 0.2], [-0.1, 0.1]]
"""


def gallery_toml() -> tuple[bytes, ...]:
    """The robots that come along, and one with every key."""
    folder = files("pivident.robot.gallery")
    names = ("planar_2r", "emps", "mitsubishi_rv2sq", "staubli_tx40")
    return tuple((folder / f"{name}.toml").read_bytes() for name in names)


def grown_toml(rng: random.Random, bases: tuple[bytes, ...]) -> bytes:
    """Lines of files of this kind, in disorder, with values of any kind."""
    lines = [line for base in bases for line in base.decode().split("\n")]
    chosen = []
    for line in rng.sample(lines, min(len(lines), rng.randrange(1, 25))):
        key, equals, _ = line.partition("=")
        chosen.append(f"{key}= {toml_value(rng)}" if equals and rng.random() < 0.5 else line)
    return "\n".join(chosen).encode("utf-8", "replace")


def toml_value(rng: random.Random, depth: int = 0) -> str:
    """Any value of TOML."""
    kind = rng.randrange(8)
    if kind == 0 and depth < 4:
        return f"[{', '.join(toml_value(rng, depth + 1) for _ in range(rng.randrange(4)))}]"
    if kind == 1 and depth < 4:
        pairs = (f"k{i} = {toml_value(rng, depth + 1)}" for i in range(rng.randrange(4)))
        return f"{{{', '.join(pairs)}}}"
    if kind == 2:
        return rng.choice(("true", "false", "1979-05-27", "07:32:00", "1979-05-27T07:32:00Z"))
    if kind in (3, 4):
        return rng.choice(NUMBERS)
    return '"' + rng.choice(TEXTS).replace('"', "'").replace("\\x", "") + '"'


# ---------------------------------------------------------------------------------------- URDF

URDF = b"""<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="l1"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="2.5"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.05"/></inertial></link>
  <link name="l2"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.05"/></inertial></link>
  <link name="tool"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="l1"/>
    <origin xyz="0 0 0.3" rpy="1.57 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="100"/>
    <dynamics damping="0.5" friction="1"/></joint>
  <joint name="j2" type="prismatic"><parent link="l1"/><child link="l2"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1" velocity="1" effort="10"/></joint>
  <joint name="j3" type="fixed"><parent link="l2"/><child link="tool"/></joint>
</robot>
"""

URDF_CHUNKS = (
    "<!DOCTYPE r>", '<!DOCTYPE r [<!ENTITY a "b">]>', '<!DOCTYPE r SYSTEM "file:///etc/passwd">',
    '<!DOCTYPE r [<!ENTITY % x SYSTEM "http://localhost:9/x"> %x;]>', "&a;", "&#0;", "&#x1b;",
    "<![CDATA[", "]]>", "<!--", "-->", "<?php ?>", '<?xml version="1.0" encoding="utf-16"?>',
    '<?xml version="1.1"?>', '<?xml version="1.0" encoding="utf-7"?>', "<a>" * 2000, "</robot>",
    '<link name="l1"/>',
    '<joint name="x" type="floating"><parent link="l1"/><child link="l3"/></joint>',
    'xmlns="urn:x"', '<mimic joint="j1"/>', "<inertial/>", '<origin xyz="nan 0 0"/>', "&lt;",
    '<xi:include href="/etc/passwd" xmlns:xi="http://www.w3.org/2001/XInclude"/>', "\x85", "\u2028",
)  # fmt: skip


def grown_urdf(rng: random.Random) -> bytes:
    """A tree, or nearly one, of links and joints."""
    names = [
        rng.choice(("l", "é", "<", "a" * 50, "[", "=")) + str(k) for k in range(rng.randrange(1, 8))
    ]
    parts = [f'<link name="{_xml(name)}">{_inertial(rng)}</link>' for name in names]
    for k, child in enumerate(names[1:], start=1):
        parent = rng.choice(names[:k] if rng.random() < 0.9 else names)
        kind = rng.choice(
            ("revolute", "continuous", "prismatic", "fixed", "planar", "floating", "")
        )
        inner = f'<parent link="{_xml(parent)}"/><child link="{_xml(child)}"/>'
        if rng.random() < 0.5:
            inner += (
                f'<axis xyz="{_triple(rng)}"/><origin xyz="{_triple(rng)}" rpy="{_triple(rng)}"/>'
            )
        if rng.random() < 0.5:
            inner += (
                f'<limit lower="{_value(rng)}" upper="{_value(rng)}" velocity="{_value(rng)}"/>'
            )
        if rng.random() < 0.3:
            inner += f'<dynamics damping="{_value(rng)}" friction="{_value(rng)}"/>'
        if rng.random() < 0.1:
            inner += f'<mimic joint="j{rng.randrange(9)}"/>'
        parts.append(f'<joint name="j{k}" type="{kind}">{inner}</joint>')
    rng.shuffle(parts)
    return f'<robot name="{_xml(rng.choice(TEXTS))}">{"".join(parts)}</robot>'.encode()


def _inertial(rng: random.Random) -> str:
    if rng.random() < 0.4:
        return ""
    moments = "".join(f' i{ax}="{_value(rng)}"' for ax in ("xx", "xy", "xz", "yy", "yz", "zz"))
    return f'<inertial><mass value="{_value(rng)}"/><inertia{moments}/></inertial>'


def _value(rng: random.Random) -> str:
    return rng.choice(NUMBERS) if rng.random() < 0.2 else f"{rng.gauss(0, 2):.3g}".lstrip("-")


def _triple(rng: random.Random) -> str:
    return " ".join(_value(rng) for _ in range(3))


def _xml(text: str) -> str:
    from xml.sax.saxutils import quoteattr

    return quoteattr(text.replace("\x7f", "")).strip("\"'")


# ----------------------------------------------------------------------------------------- CSV

CSV_CHUNKS = (
    "\0", "\ufeff", '"', '""', "'", ";", "\t", ",", "\n", "\r", "\r\n", "#", "\n\n\n", "," * 5000,
    "\n" * 3000, '"' + "a" * 200000, "1,2,3\n" * 50, "nan", "inf", "1e400", "1,5", "=1+1",
    "\x1b[2J", "\u2028", "\x85", "\x0b", "\x0c", "\x1c", "a" * 70000, '"a\nb"', "0x10", "1_000",
    "١", "−1",
)  # fmt: skip


def grown_csv(rng: random.Random) -> bytes:
    """A table, or nearly one, of any width."""
    separator = rng.choice(",;\t,,")
    columns = rng.choice((1, 2, 3, 7, 7, 40))
    cell = (
        (lambda: rng.choice(TEXTS + NUMBERS))
        if rng.random() < 0.3
        else (lambda: f"{rng.gauss(0, 1):.4g}")
    )
    rows = []
    if rng.random() < 0.8:
        rows.append(
            separator.join(
                rng.choice((f"c{k}", rng.choice(TEXTS), "a")) if rng.random() < 0.1 else f"c{k}"
                for k in range(columns)
            )
        )
    for _ in range(rng.randrange(20)):
        width = columns if rng.random() < 0.98 else rng.randrange(9)
        rows.append(separator.join(cell() for _ in range(width)))
    end = rng.choice(("\n", "\n", "\n", "\r\n", "\r"))
    return (
        rng.choice(("", "", "\ufeff", "# a comment\n")) + end.join(rows) + rng.choice(("", end))
    ).encode()


# -------------------------------------------------------------------------------------- arrays


def arrays() -> dict[str, np.ndarray]:
    """What a log in arrays may hold."""
    table = log_table()
    return {
        "t": table[:, 0], "q": table[:, 1:3], "tau": table[:, 5:7].T.copy(), "n": np.arange(9),
        "flag": np.array([True, False]), "single": np.float32(table[:5]), "empty": np.zeros((0, 2)),
    }  # fmt: skip


def npz_seeds() -> tuple[bytes, ...]:
    packed, plain, odd = io.BytesIO(), io.BytesIO(), io.BytesIO()
    np.savez_compressed(packed, **arrays())
    np.savez(plain, **arrays())
    strange = {"o": np.array([{}], dtype=object), "s": np.array(["a"]), "z": np.array([1j])}
    np.savez(odd, allow_pickle=True, **strange, x=np.arange(3.0))
    return packed.getvalue(), plain.getvalue(), odd.getvalue()


def npy_seeds() -> tuple[bytes, ...]:
    made = []
    for array in (*arrays().values(), np.asfortranarray(log_table()), log_table().astype("i2")):
        stream = io.BytesIO()
        np.save(stream, array)
        made.append(stream.getvalue())
    return tuple(made)


def mat_seeds() -> tuple[bytes, ...]:
    from scipy.io import savemat

    made = []
    for options in ({}, {"do_compression": True}):
        stream = io.BytesIO()
        content = {
            name: np.atleast_2d(np.asarray(v, float)) for name, v in arrays().items() if v.size
        }
        content |= {"text": "abc", "cell": np.array([1, "a"], dtype=object), "st": {"a": 1.0}}
        content |= {"c": np.array([[1j]]), "u": np.uint8([[1, 2]]), "l": np.array([[True]])}
        savemat(stream, content, **options)
        made.append(stream.getvalue())
    return tuple(made)


def hdf5_seeds() -> tuple[bytes, ...]:
    import h5py

    made = []
    for options in ({}, {"compression": "gzip", "chunks": True}):
        stream = io.BytesIO()
        with h5py.File(stream, "w", userblock_size=512) as file:
            for name, values in arrays().items():
                own = options if values.size and values.ndim else {}
                file.create_dataset(name, data=values, **own).attrs["MATLAB_class"] = np.bytes_(
                    "double"
                )
            file.create_group("#refs#")
            file["text"] = "abc"
            file["soft"] = h5py.SoftLink("/q")
        made.append(stream.getvalue())
    return tuple(made)


def parquet_seeds() -> tuple[bytes, ...]:
    import polars as pl

    made = []
    table = {f"c{k}": column for k, column in enumerate(log_table().T)}
    odd = {
        "i": [1, 2, None],
        "s": ["a", "b", "c"],
        "l": [[1.0], [], [2.0]],
        "b": [True, False, None],
        "u": [1.5, 2.5, 3.5],
    }
    nested = {"n": [{"a": {"b": [1]}}], "d": [date(2020, 1, 1)], "f": [1.0]}
    for content, packing in (
        (table, "zstd"),
        (table, "uncompressed"),
        (table, "snappy"),
        (odd, "zstd"),
        (nested, "gzip"),
    ):
        stream = io.BytesIO()
        pl.DataFrame(content).write_parquet(stream, compression=packing)
        made.append(stream.getvalue())
    return tuple(made)


# ---------------------------------------------------------------------------------------- JSON

JSON_CHUNKS = (
    "[" * 100000, '{"a":' * 20000, "1" * 5000, "NaN", "Infinity", "-", "null", "true", '"\\ud800"',
    "\0", '"layout": 1', '"hash": 3', '"programs": 3', '"runs": "x"', '"programs": null', "1e999",
)  # fmt: skip


def manifest_seed() -> bytes:
    from pivident.study.scenario import read_scenario
    from pivident.study.store import Store

    with tempfile.TemporaryDirectory() as folder:
        scenario = read_scenario(STUDY.decode().split("[vary")[0], "study")
        with Store(Path(folder)).opened(scenario, 6):
            pass
        return (Path(folder) / "manifest.json").read_bytes()


@cache
def result_seeds() -> tuple[bytes, bytes]:
    """An identification of the planar arm, and the model made of it, as they are stored."""
    from pivident.dynamics.parameters import nominal_values, standard_parameters
    from pivident.dynamics.regressor import Regressor
    from pivident.estimation.export import to_json
    from pivident.estimation.identify import identify
    from pivident.estimation.problem import Problem
    from pivident.export import model_json
    from pivident.export.runnable_model import runnable_model
    from pivident.recording import Recording
    from pivident.robot import load_robot

    robot, t = load_robot("planar_2r"), np.arange(3000)[:, None] / 500.0
    phase = t * [3.0, 5.0]
    q, dq, ddq = np.sin(phase), [3.0, 5.0] * np.cos(phase), -np.square([3.0, 5.0]) * np.sin(phase)
    standard = standard_parameters(robot)
    tau = Regressor.build(robot, standard).torque(q, dq, ddq, nominal_values(robot, standard))
    tau += 0.1 * np.random.default_rng(1).standard_normal(tau.shape)
    log = Recording("sines", robot.joint_names, q, tau, 500.0, torque_timing="sampled")
    found = identify(Problem(robot, (log,)), "ls")
    return to_json(found).encode(), bytes(model_json.to_json(runnable_model(found)).content)


def grown_json(rng: random.Random, base: bytes) -> bytes:
    """The same keys with values of any kind."""
    content = json.loads(base)
    for key in rng.sample(list(content), rng.randrange(1, 5)):
        content[key] = rng.choice((None, 1, "x", [], {}, [1], {"a": 1}, 1e300, True, list(TEXTS)))
    return json.dumps(content).encode()


def packed(content: bytes) -> bytes:
    """Content as a gzip file."""
    return gzip.compress(content, 1)


# ---------------------------------------------------------------------------------------- bags


def _joint_states(is_ros1: bool):
    """A typestore and messages of joint states, among them partial ones and other orders."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    state = store.types["sensor_msgs/msg/JointState"]
    own = {"seq": 0} if is_ros1 else {}
    messages = []
    for k, row in enumerate(log_table(30)):
        stamp = store.types["builtin_interfaces/msg/Time"](1, 1_000_000 * k)
        header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="b", **own)
        names, columns = (["q1", "q2"], [1, 2]) if k % 3 else (["q2"], [2])
        q, tau = row[columns], row[[5, 6]][: len(names)]
        messages.append((10**9 + 1_000_000 * k, state(header, names, q, q[:0], tau)))
    return store, messages


def _written_bag(kind: str) -> bytes:
    """A bag of one file: ``bag``, ``lz4.bag``, ``bz2.bag``, ``mcap``, ``zstd.mcap``, ``db3``."""
    from rosbags.rosbag1 import Writer as Ros1Writer
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
    from rosbags.rosbag2 import Writer as Ros2Writer

    is_ros1 = kind.endswith("bag")
    store, messages = _joint_states(is_ros1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        if is_ros1:
            writer = Ros1Writer(path)
            if kind != "bag":
                writer.set_compression(Ros1Writer.CompressionFormat[kind[:3].upper()])
        else:
            plugin = StoragePlugin.SQLITE3 if kind == "db3" else StoragePlugin.MCAP
            writer = Ros2Writer(path, version=9, storage_plugin=plugin)
            if kind == "zstd.mcap":
                writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            name = "sensor_msgs/msg/JointState"
            topic = writer.add_connection("/joint_states", name, typestore=store)
            serialize = store.serialize_ros1 if is_ros1 else store.serialize_cdr
            for received, message in messages:
                writer.write(topic, received, serialize(message, name))
        return (path if is_ros1 else next(path.glob(f"*.{kind[-4:].lstrip('.')}"))).read_bytes()


@cache
def bag_seeds() -> tuple[bytes, ...]:
    """ROS 1 bags, plain and compressed."""
    return tuple(_written_bag(kind) for kind in ("bag", "lz4.bag", "bz2.bag"))


@cache
def mcap_seeds() -> tuple[bytes, ...]:
    """MCAP files, plain and compressed."""
    return tuple(_written_bag(kind) for kind in ("mcap", "zstd.mcap"))


@cache
def db3_seeds() -> tuple[bytes, ...]:
    """A database of ROS 2."""
    return (_written_bag("db3"),)


def habit_seeds() -> tuple[bytes, ...]:
    """Tables as controllers write them: blanks, decimal commas, titles, units, UTF-16."""
    german = "sep=;\r\nZeit;A1_Ist;A2_Ist\r\ns;Grad;Grad\r\n0,004;1,5;-2\r\n0,008;1,6;-3\r\n"
    return (
        b"timestamp actual_q_0 actual_q_1\n0.002 1.5  2\n0.004 1.6 3\n",
        german.encode(),
        german.encode("utf-16"),
        b"%time,field.position0\n1700000000000000000,0.5\n1700000000002000000,0.6\n",
    )
