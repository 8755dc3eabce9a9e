"""One axis about the vertical under names that say nothing: ``qm qg vir`` beside ``gtau``."""

import numpy as np
import pytest
import scipy.io

from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.assumption import DraftError
from pivident.experiment.init.draft import draft_experiment

#: Inertia [kg m²], viscous and dry friction, torque per unit of the command, gains of the loop.
INERTIA, VISCOUS, DRY, GAIN, KP, KD = 0.4, 0.5, 0.6, 3.5, 40.0, 4.0

AXIS = """<robot name="axis"><link name="base"/><link name="table"><inertial>
<origin xyz="0.1 0 0"/><mass value="3"/>
<inertia ixx="0.1" iyy="0.1" izz="0.37" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="table"/><axis xyz="0 0 1"/>
<limit lower="-6" upper="6" effort="100" velocity="10"/></joint></robot>"""


def turned(seconds=8.0, rate=1000, steps=10):
    """Time, reference, position and command of a PD loop at 1 kHz."""
    rng = np.random.default_rng(4)
    t = np.arange(int(seconds * rate)) / rate
    waves = [(f, *rng.uniform((0.1, 0.0), (0.2, 6.0))) for f in (0.25, 0.6, 1.3, 2.1)]
    reference = sum(a * np.sin(2 * np.pi * f * t + p) for f, a, p in waves)
    speeds = np.gradient(reference, t)
    q, dq = np.empty_like(t), speeds[0]
    u, at = np.empty_like(t), reference[0]
    for k in range(t.size):
        q[k] = at
        u[k] = KP * (reference[k] - at) + KD * (speeds[k] - dq) + 0.05 * rng.standard_normal()
        for _ in range(steps):
            friction = VISCOUS * dq + DRY * np.tanh(200 * dq)
            dq += (GAIN * u[k] - friction) / INERTIA / rate / steps
            at += dq / rate / steps
    return t, reference, np.round(q / 1e-6) * 1e-6, u


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("axis")
    t, reference, q, u = (x[:, None] for x in turned())
    (path / "axis.urdf").write_text(AXIS)
    content = {"t": t, "qg": reference, "qm": q, "vir": u, "gtau": GAIN, "note": "drive 7"}
    scipy.io.savemat(path / "log.mat", content)
    return path


def test_command_reference_and_gain_are_assumed_by_the_motion(folder):
    path = folder / "experiment.toml"
    draft = draft_experiment([folder / "log.mat"], str(folder / "axis.urdf"), out=path)
    assert not draft.troubles
    lines = {(a.table, a.key): a for a in draft.assumptions}
    tau, reference = (lines["recording.columns", key] for key in ("tau", "q_ref"))
    assert tau.value == ["vir"] and reference.value == ["qg"]
    assert tau.sure == reference.sure == "assumed"
    unit = lines["recording.units", "tau"]
    assert unit.value == [{"unit": "command", "gain": GAIN}] and unit.sure == "assumed"
    assert "'gtau'" in unit.seen and "note: text" in lines["recording", "files"].seen
    path.write_text(draft.text)
    (recording,) = load_experiment(path).recordings()
    t, wanted, q, u = turned()
    np.testing.assert_allclose(recording.q[:, 0], q, atol=1e-12)
    np.testing.assert_allclose(recording.q_ref[:, 0], wanted, atol=1e-12)
    np.testing.assert_allclose(recording.tau[:, 0], GAIN * u, rtol=1e-9)
    acceleration = np.gradient(np.gradient(q, t, edge_order=2), t)[500:-500]
    assert draft.explained["turn"] < 0.2 and np.ptp(acceleration) > 1.0
    assert lines["identify", "methods"].value == ["ls", "iv-full-rate", "piv"]


@pytest.mark.parametrize("kind", ["noise", "late command"])
def test_columns_that_the_motion_does_not_explain_are_no_torque(folder, tmp_path, kind):
    """Nor are those that look like positions: a policy's action, 30 ms before the joint follows."""
    t, _, q, _ = turned()
    noise = np.random.default_rng(5).standard_normal(t.size)
    other = noise if kind == "noise" else np.roll(q, -30)
    scipy.io.savemat(tmp_path / "log.mat", {"t": t, "qm": q, "vir": other})
    with pytest.raises(DraftError, match="seems to hold torques"):
        draft_experiment(
            [tmp_path / "log.mat"], str(folder / "axis.urdf"), out=tmp_path / "experiment.toml"
        )


def test_an_axis_that_feels_no_gravity_has_a_law_all_the_same(folder):
    """Its reference is named: the law is identified, and gravity in it is nothing to look for."""
    t, reference, q, u = turned()
    columns = {"time": t, "q1": q, "r1": reference, "tau1": GAIN * u}
    log = folder / "named.csv"
    np.savetxt(
        log, np.column_stack([*columns.values()]), "%.9g", ",", header=",".join(columns),
        comments="",
    )  # fmt: skip
    draft = draft_experiment([log], str(folder / "axis.urdf"), out=folder / "named.toml")
    (line,) = [a for a in draft.assumptions if (a.table, a.key) == ("controller", "type")]
    assert line.value == "identify" and not draft.troubles
