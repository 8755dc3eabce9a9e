"""Robots, experiments, studies and bounds to begin with, and a grammar of their lines."""

from __future__ import annotations

import random
from importlib.resources import files

from fuzzing.mutations import NUMBERS, TEXTS

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
