# ruff: noqa: E501  (one case, one line)
"""Mistakes in what was logged: units, columns, signs, ratios, timing, motion, controller."""

import numpy as np
import pytest

from tests.questions.conftest import answered
from tests.questions.material import EXPERIMENT, RATE, Case, changed, exchanged, log, replaced

DEGREE = np.pi / 180


def signals(question: str, made, *answer: str, code: int = 4, **more) -> Case:
    return Case(question, answer, log=made, code=code, **more)


def both(*names: str):
    return lambda change: changed(**{name: change for name in names})


positions, references, torques = both("q1", "q2"), both("r1", "r2"), both("tau1", "tau2")
motion = both("q1", "q2", "r1", "r2")


def said(*changes: tuple[str, str]) -> str:
    return replaced(*changes)


def units(line: str) -> str:
    return replaced(("[controller]", f"units = {line}\n\n[controller]"))


def gains(kp: str = "[6000, 2500]", kd: str = "[180, 60]", more: str = "", kind: str = "pd") -> str:
    return replaced(('"pd"', f'"{kind}"'), ("[6000, 2500]", kp), ("[180, 60]", kd + more))


def delayed(x, samples: int):
    return np.r_[np.full(samples, x[0]), x[:-samples]]


def with_speeds(filtered: float = 0.0, step: float = 0.0, factor: float = 1.0):
    """A log with reference speeds, made worse."""
    made = log()
    for j in "12":
        speed = np.gradient(made[f"r{j}"]) * RATE
        for k in range(1, len(speed)):
            speed[k] = speed[k] + filtered * (speed[k - 1] - speed[k])
        made[f"dr{j}"] = factor * (np.round(speed / step) * step if step else speed)
    return made


SPEEDS = said(('q_ref = ["r1", "r2"]', 'q_ref = ["r1", "r2"], dq_ref = ["dr1", "dr2"]'))


def still(name: str):
    made = log()
    rng = np.random.default_rng(0)
    made[f"q{name}"] = 0.3 + 1e-5 * rng.standard_normal(len(made["time"]))
    made[f"r{name}"] = np.full(len(made["time"]), 0.3)
    return made


def every(step: int):
    return {name: values[::step] for name, values in log().items()}


def cascade(**declared: str) -> str:
    """Gains of the cascade that the PD law of the log is: kp = 6000/180, kv = 180 and so on."""
    given = {"kp": "[33.333, 41.667]", "kv": "[180, 60]"} | declared
    lines = "".join(f"{key} = {value}\n" for key, value in given.items())
    return said(('type = "pd"\nkp = [6000, 2500]\nkd = [180, 60]\n',
                 f'type = "cascade"\nspeed_feed_forward = 1.0\n{lines}'))  # fmt: skip


CASES = [
    # units of positions
    signals("positions are in degrees but read as radians", motion(np.rad2deg), "line 3", "shoulder", "far beyond its limits", "degrees", code=1),
    signals("positions are in radians but declared as degrees", log(), "line 7", "positions seem to be in rad", "deg was taken", text=units('{q = "deg", q_ref = "deg"}')),
    signals("positions are in millidegrees", motion(lambda x: 1e3 * np.rad2deg(x)), "shoulder", "far beyond its limits", code=1),
    signals("positions are in encoder counts", motion(lambda x: np.round(x / (2 * np.pi) * 4096)), "shoulder", "far beyond its limits", code=1),
    signals("positions are in turns", motion(lambda x: x / (2 * np.pi)), "kp of shoulder", "turns", "rev"),
    signals("positions are those of the motor", motion(lambda x: 50 * x), "shoulder", "far beyond its limits", "of the motor", "reduction", code=1),
    signals("joint positions are declared as motor positions", log(), "positions seem to be of the joint side", "gear ratios", text=said(('robot = "planar_2r"', 'robot = {model = "planar_2r", reduction = [50, 50]}'), ("files =", 'side = {q = "motor"}\nfiles ='))),
    signals("only the references are in degrees", references(np.rad2deg), "q_ref", "shoulder", "degrees", code=1),
    signals("only the positions are in degrees", positions(np.rad2deg), "q of joint 'shoulder'", "degrees", code=1),
    signals("only the second joint is in degrees", both("q2", "r2")(np.rad2deg), "elbow", "far beyond its limits", "degrees", code=1),
    signals("angles wrap around", both("q1")(lambda x: np.mod(x, 2 * np.pi)), "q of shoulder", "jumps by a full turn"),
    signals("a joint has a different zero", both("q1", "r1")(lambda x: x + 2.2), "shoulder", "zero of the position", "gravity"),
    signals("a joint counts in the opposite direction", both("q2", "r2", "tau2")(np.negative), "elbow seems to turn in the opposite direction", "axis"),
    signals("the zero of a joint is a quarter turn away", both("q1", "r1")(lambda x: x - np.pi / 2), "zero of shoulder", "90°", "position_offset"),
    signals("a joint's sign is reversed", both("q2", "r2")(np.negative), "friction of elbow dissipates -", "would supply energy", "reverse the sign of tau or q of elbow"),
    signals("all joints' signs are reversed", motion(np.negative), "friction of shoulder dissipates -", "would supply energy", "reverse the sign of tau"),
    # units of torques
    signals("torques are in mN m", torques(lambda x: 1e3 * x), "torque of shoulder is 1000.056 ± 0.085 times", "times that of the description"),
    signals("torques are in kN m", torques(lambda x: 1e-3 * x), "torque of shoulder", "0.001", "times that of the description"),
    signals("torques are in amperes but read as N m", both("tau1", "tau2")(lambda x: x / 12.5), "torque of shoulder", "0.08", "drive gain"),
    signals("torques are those of the motor", torques(lambda x: x / 50), "torque of shoulder", "motor", text=said(('robot = "planar_2r"', 'robot = {model = "planar_2r", reduction = [50, 50]}'))),
    signals("joint torques are declared as motor torques", log(), "torque of shoulder", 'side = {tau = "joint"}', text=said(('robot = "planar_2r"', 'robot = {model = "planar_2r", reduction = [50, 50]}'), ("files =", 'side = {tau = "motor"}\nfiles ='))),
    signals("one torque has a different unit from the other", both("tau2")(lambda x: x / 12.5), "torque of elbow is 0.0799"),
    signals("a torque's sign is reversed", both("tau1")(np.negative), "shoulder", "sign"),
    signals("all torques' signs are reversed", torques(np.negative), "shoulder", "sign"),
    signals("a gear ratio is wrong", both("tau2")(lambda x: x * 2.2), "torque of elbow is 2.199", "gear ratio", code=0),
    signals("the sign of a gear is reversed", log(), "elbow", "sign", text=said(('robot = "planar_2r"', 'robot = {model = "planar_2r", reduction = [50, -50]}'), ("files =", 'side = {q = "joint", tau = "motor"}\nfiles ='))),
    signals("the gain of the current has the wrong sign", torques(lambda x: x / 12.5), "sign", "shoulder", text=units('{tau = {unit = "A", gain = -12.5}}')),
    signals("the gain of the current is per milliampere", torques(lambda x: x / 12.5), "torque of shoulder", "0.001", text=units('{tau = {unit = "mA", gain = 12.5}}')),
    # columns
    signals("the torques are swapped", exchanged(log(), ("tau1", "tau2")), "torque columns fit in another order", "shoulder", "columns.tau"),
    signals("the positions are swapped", exchanged(log(), ("q1", "q2"), ("r1", "r2")), "order", "shoulder"),
    signals("the references are swapped", exchanged(log(), ("r1", "r2")), "q and q_ref", "different order", "shoulder follows the reference of elbow"),
    signals("reference and measurement are swapped", exchanged(log(), ("q1", "r1"), ("q2", "r2")), "shoulder", "reference and measurement are swapped"),
    signals("speeds are named as positions", log() | {f"dq{j}": np.gradient(log()[f"q{j}"]) * RATE for j in "12"}, "line 5", "shoulder", "q", "speed", text=EXPERIMENT.replace('q = ["q1", "q2"]', 'q = ["dq1", "dq2"]')),
    signals("positions and speeds are swapped in the header", (lambda m: m | {f"q{j}": np.gradient(m[f"q{j}"]) * RATE for j in "12"} | {f"dq{j}": m[f"q{j}"] for j in "12"})(log()), "derivative", "q", "shoulder"),
    signals("the speed is named as the torque", log() | {f"v{j}": np.gradient(log()[f"q{j}"]) * RATE for j in "12"}, "torque of shoulder is its speed", "columns.tau", text=EXPERIMENT.replace('["tau1", "tau2"]', '["v1", "v2"]')),
    signals("the name of a column suggests another quantity", log() | {f"dq{j}": log()[f"q{j}"] for j in "12"}, "'dq1'", "q (position)", "speed", code=0, text=EXPERIMENT.replace('q = ["q1", "q2"]', 'q = ["dq1", "dq2"]')),
    signals("the columns of the torque are listed backward", log(), "tau are numbered 2, 1", "swapped", text=EXPERIMENT.replace('["tau1", "tau2"]', '["tau2", "tau1"]')),
    signals("columns bear the names of other joints", {n.replace("q1", "elbow_pos").replace("q2", "shoulder_pos"): v for n, v in log().items()}, "'elbow_pos'", "belongs to shoulder", text=EXPERIMENT.replace('"q1"', '"elbow_pos"').replace('"q2"', '"shoulder_pos"')),
    signals("the measurement was logged as the reference", exchanged(log()) | {"r1": log()["q1"], "r2": log()["q2"]}, "reference of shoulder, elbow is the measured position itself"),
    signals("the reference of a joint was not logged", both("r2")(lambda x: 0 * x), "reference of elbow never changes"),
    signals("the reference is a speed", references(lambda x: np.gradient(x) * RATE), "q_ref of shoulder", "speed"),
    signals("the reference has a different zero", both("r1")(lambda x: x + 0.5), "reference of shoulder", "0.5", "zeros differ", code=0),
    signals("the sign of the reference is reversed", both("r2")(np.negative), "reference of elbow", "wrong sign"),
    signals("the reference is that of another motion", references(lambda x: x[::-1]), "shoulder", "does not follow its reference", code=0),
    signals("the reference speed is in degrees", with_speeds(factor=180 / np.pi), "dq_ref of shoulder", "57.3 times", "units", text=SPEEDS),
    signals("an acceleration is named as the reference speed", log() | {f"dr{j}": np.gradient(np.gradient(log()[f"r{j}"])) * RATE**2 for j in "12"}, "dq_ref of shoulder", "not explained", text=SPEEDS),
    signals("the reference speed was filtered", with_speeds(filtered=0.97), "dq_ref of shoulder", "filtered", text=SPEEDS, code=0),
    signals("the reference speeds are swapped", exchanged(with_speeds(), ("dr1", "dr2")), "dq_ref of shoulder", "derivative of q_ref", text=SPEEDS),
    # what the channels are like
    signals("a position is constant", both("q2")(lambda x: 0 * x + 0.3), "q of elbow is 0.3 at every sample", "column", code=1),
    signals("a torque is constant", both("tau2")(lambda x: 0 * x), "tau of elbow is 0 at every sample", "column", code=1),
    signals("a torque is saturated", both("tau1")(lambda x: np.clip(x, -25, 25)), "tau of shoulder", "cut off at", code=1),
    signals("a torque is frozen for a while", both("tau2")(lambda x: np.r_[x[:1500], np.full(120, x[1500]), x[1620:]]), "tau of elbow stays the same", "samples 1500 to 1619", "while its joint moves", "left out of the equations", code=0),
    signals("a torque has a dead band", both("tau2")(lambda x: np.where(np.abs(x) < 4, 0, x)), "tau of elbow", "exactly 0"),
    signals("a torque has a spike", both("tau1")(lambda x: np.where(np.arange(len(x)) == 900, 500.0, x)), "tau of shoulder", "sample 900", code=0),
    signals("a position has a spike", both("q1")(lambda x: np.where(np.arange(len(x)) == 900, x + 0.5, x)), "q of shoulder", "sample 900", code=0),
    signals("positions have too few digits", positions(lambda x: np.round(x, 3)), "q of shoulder", "significant digits", code=0),
    signals("torques have too few digits", torques(lambda x: np.round(x / 5) * 5), "tau of shoulder", "steps of 5", code=0),
    signals("nothing moves", {n: (0.3 + 1e-5 * np.random.default_rng(k).standard_normal(len(v)) if n[0] == "q" else v) for k, (n, v) in enumerate(log().items())}, "standstill", "the whole arm", code=1),
    signals("only one joint moves", still("2"), "standstill", "elbow", "mrad", code=1),
    signals("the record is too short", {n: v[500:600] for n, v in log().items()}, "too short", "100 samples for", code=1),
    signals("the record lasts a second", {n: v[:1000] for n, v in log().items()}, "record is short", "1 s of motion", code=0),
    signals("the record has five samples", {n: v[:5] for n, v in log().items()}, "5 sample(s)", "16", code=1),
    signals("the rate is too low for the motion", every(40), "rate of 25 Hz is low for this motion", code=1),
    signals("the torque was logged late", torques(lambda x: delayed(x, 10)), "torque", "9.995 ± 0.016 ms", "later than the positions", "delay"),
    signals("one torque was logged late", both("tau2")(lambda x: delayed(x, 8)), "elbow", "later"),
    signals("the positions were logged late", motion(lambda x: delayed(x, 10)), "torque", "earlier than the positions"),
    signals("the declared delay is in milliseconds", torques(lambda x: delayed(x, 10)), "delay", "10 s late", "10 ms are 0.01", text=said(("files =", "delay = 10\nfiles =")), code=1),
    signals("the torque is held for several samples", torques(lambda x: np.repeat(x[::4], 4)), "torque changes only once every 4 samples", "250 Hz", "control_rate", code=0),
    signals("the positions are repeated", positions(lambda x: np.repeat(x[::5], 5)), "position of shoulder changes only once every 5 samples", "200 Hz"),
    signals("the control rate is too low", log(), "control_rate is 250 Hz", "every sample", text=said(("files =", "control_rate = 250\nfiles ="))),
    signals("the control rate is in kHz", log(), "control_rate is 1 Hz", "kHz", text=said(("files =", "control_rate = 1\nfiles ="))),
    signals("rows were logged twice", {n: np.repeat(v, 2) for n, v in log().items()}, "one in 2 has new values", "2 times slower than the log", code=0),
    signals("samples are missing and the stamps do not show it", {n: (np.delete(v, range(1500, 1506)) if n != "time" else v[:-6]) for n, v in log().items()}, "skip", "missing from the log", code=0),
    # the controller
    signals("the gains are per degree", log(), "line 9", "kp of shoulder", "per degree", text=gains("[104.7, 43.63]", "[3.1416, 1.0472]")),
    signals("one gain is wrong", log(), "line 9", "kp of elbow", "25000", "give 2500", text=gains("[6000, 25000]")),
    signals("the gains of two joints are swapped", log(), "line 9", "kp of shoulder", "2500", "give 6000", text=gains("[2500, 6000]", "[60, 180]")),
    signals("kp and kd are swapped", log(), "line 9", "kp of shoulder", "180", "give 6000", text=gains("[180.0, 60.0]", "[6000, 2500]")),
    signals("kd is given as a time", log(), "line 10", "kd of shoulder", "0.03", "give 180", text=gains(kd="[0.03, 0.024]")),
    signals("the drive gain is given twice", log(), "kp of shoulder, drive gain included", "75000", "drive_gain", text=gains(more="\ndrive_gain = 12.5")),
    signals("the drive gain has the wrong sign", log(), "line 11", "drive_gain", "reversed", "shoulder", text=gains(more="\ndrive_gain = [-1, 1]")),
    signals("the gains of a cascade are those of a PD law", log(), "kp kv of shoulder", text=cascade(kp="[6000, 2500]")),
    signals("the speed gain of a cascade is wrong", log(), "kv of elbow", "600", text=cascade(kv="[180, 600]")),
    signals("the law is unstable", log(), "loop of", "unstable", "1000 Hz", text=gains(kd="[1800, 6000]")),
    signals("the law is unstable at the declared control rate", log(), "unstable", "100 Hz", text=said(("files =", "control_rate = 100\nfiles ="))),
    signals("there is no damping", log(), "kd of shoulder", "is 0", text=gains(kd="[0, 0]")),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.question)
def test_the_answer_names_cause_and_place(ask, case):
    code, lines = ask(case)
    assert answered(lines, case.answer), "\n".join(lines)
    assert code == case.code, "\n".join(lines)
