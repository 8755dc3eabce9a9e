"""An MJCF with position actuators and a log of positions: joints, of which MuJoCo has the truth."""

import json
import os
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pivident.app.cli import main
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.experiment import load_experiment
from pivident.robot.mjcf_actuators import actuator_law
from pivident.studies.simulators import simulator_of_experiment
from pivident.studies.simulators.held_out import HeldOut
from pivident.studies.simulators.simulator_of_experiment import simulator_of
from tests.studies.simulators.two_links import KP, KV, POSITIONS, RATE, TRUE, model_text, write_log


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What a newcomer has, and what `init --yes` makes of it."""
    made = tmp_path_factory.mktemp("links")
    (made / "robot.xml").write_text(model_text())
    write_log(made / "log.csv")
    files = ["init", str(made / "log.csv"), "--robot", str(made / "robot.xml"), "--yes"]
    assert main([*files, "--out", str(made / "experiment.toml")]) == 0
    return made


@pytest.fixture(scope="module")
def fitted(folder):
    return simulator_of(load_experiment(folder / "experiment.toml"), "mjcf", folder / "out")


def assert_true(fit, within=0.06):
    assert fit.converged
    for quantity, values in TRUE.items():
        found = [v.value for v in fit.of(quantity).values()]
        np.testing.assert_allclose(found, values, rtol=within, err_msg=quantity)


def changed(folder, tmp_path, old, new, robot=None, seconds=None):
    """The experiment with other lines, beside the log or its begin and a robot's file."""
    for name in ("log.csv", "robot.xml"):
        (tmp_path / name).write_text((folder / name).read_text())
    if seconds is not None:
        lines = (folder / "log.csv").read_text().splitlines()[: 1 + round(seconds * RATE)]
        (tmp_path / "log.csv").write_text("\n".join([*lines, ""]))
    if robot is not None:
        (tmp_path / "robot.xml").write_text(robot)
    text = (folder / "experiment.toml").read_text()
    assert old in text
    path = tmp_path / "experiment.toml"
    path.write_text(text.replace(old, new))
    return path


def test_init_declares_the_law_of_the_actuators(folder):
    experiment = load_experiment(folder / "experiment.toml")
    law = experiment.content.controller
    assert (law.type, law.kp, law.kd) == ("pd", list(KP), list(KV))
    assert law.speed_feed_forward == 0.0
    assert experiment.content.recording[0].control_rate == 4000.0
    assert not [r for r in check_experiment(experiment.path).remarks if r.kind == "actuators"]


def test_joints_without_armature_and_friction_are_where_a_fit_may_start(fitted):
    fit, _, judged = fitted
    assert_true(fit)
    rms = judged.rms()
    assert (rms["after"] < 0.02 * rms["before"]).all()
    assert not fit.notes and not judged.findings()


@pytest.mark.parametrize("value", [1e-8, 0.02])
def test_a_fit_ends_where_it_ends_from_any_start(folder, tmp_path, fitted, value, monkeypatch):
    monkeypatch.setattr(simulator_of_experiment, "held_out_errors", lambda *_: None)
    joint = f'armature="{value}" damping="{10 * value}" frictionloss="{30 * value}" axis'
    path = changed(folder, tmp_path, "", "", model_text().replace("axis", joint))
    fit, _, _ = simulator_of(load_experiment(path), "mjcf", tmp_path / "out", held_out=0.25)
    for one, other in zip(fit.values, fitted[0].values, strict=True):
        assert one.value == pytest.approx(other.value, abs=0.3 * other.std + 1e-9), one
    assert fit.of("armature")["elbow"].start > 1e-4


def test_soft_dry_friction_of_mujoco_is_found_as_armature(folder, tmp_path):
    path = changed(folder, tmp_path, "", "")
    write_log(tmp_path / "log.csv", hard=False)
    fit, _, _ = simulator_of(load_experiment(path), "mjcf", tmp_path / "out", held_out=0.0)
    excess = {
        quantity: [
            v.value / true - 1.0 for v, true in zip(fit.of(quantity).values(), own, strict=True)
        ]
        for quantity, own in TRUE.items()
    }
    assert np.abs([excess["damping"], excess["frictionloss"]]).max() < 0.04
    assert min(excess["armature"]) > 0.03 and max(excess["armature"]) < 0.12


def test_a_law_of_another_form_is_a_reservation_with_the_line_that_mends_it(
    folder, tmp_path, capsys
):
    path = changed(folder, tmp_path, "speed_feed_forward = 0.0", "", seconds=4.0)
    remarks = [r for r in check_experiment(path).remarks if r.kind == "actuators"]
    (remark,) = remarks
    assert remark.severity == "warning" and remark.place == ("controller", "speed_feed_forward")
    assert "damps by kd (dq_ref - dq), the actuators of robot.xml by -kd dq" in remark.message
    main(["fit-simulator", str(path), "--held-out", "0"])
    printed = capsys.readouterr().out
    assert "write speed_feed_forward = 0" in printed
    values = json.loads((tmp_path / "experiment-simulator" / "simulator.json").read_text())
    assert any("speed_feed_forward = 0" in text for text in values["findings"])
    damping = [v["value"] for v in values["values"] if v["quantity"] == "damping"]
    assert damping[0] > 5 * TRUE["damping"][0]  # what the reservation warns of
    page = (tmp_path / "experiment-simulator" / "simulator.html").read_text()
    assert "speed_feed_forward = 0" in page


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("kp = [60.0, 25.0]", "kp = [60.0, 20.0]", "elbow 20 (file: 25).*write kp = [60.0, 25.0]"),
        ("kd = [2.0, 0.8]", "kd = 1.0", "shoulder 1 (file: 2).*write kd = [2.0, 0.8]"),
        ('type = "pd"', 'type = "pid"\nki = 3.0', "has an integrator.*leave ki out"),
    ],
)
def test_other_gains_than_those_of_the_actuators_are_remarked(folder, tmp_path, old, new, says):
    remarks = check_experiment(changed(folder, tmp_path, old, new)).remarks
    said = " ".join(f"{r.message} {r.next_step}" for r in remarks if r.kind == "actuators")
    first, _, second = says.partition(".*")
    assert first in said and second in said


def test_the_same_law_as_a_cascade_is_none_other(folder, tmp_path):
    text = 'type = "cascade"\nkv = [2.0, 0.8]'
    path = changed(folder, tmp_path, 'type = "pd"', text)
    lines = path.read_text().replace("kp = [60.0, 25.0]", "kp = [30.0, 31.25]")
    path.write_text(lines.replace("kd = [2.0, 0.8]\n", ""))
    assert not [r for r in check_experiment(path).remarks if r.kind == "actuators"]


def test_commands_beyond_ctrlrange_and_limits_are_remarked(folder, tmp_path):
    text = model_text(POSITIONS.replace("/>", ' ctrlrange="-.4 .4" forcerange="-9 9"/>'))
    remarks = check_experiment(changed(folder, tmp_path, "", "", text)).remarks
    said = " ".join(f"{r.message} {r.next_step}" for r in remarks if r.kind == "actuators")
    assert "beyond ctrlrange in robot.xml, -0.4 to 0.4 rad" in said
    assert "write limit = 9.0" in said
    files = [str(tmp_path / "log.csv"), "--robot", str(tmp_path / "robot.xml"), "--yes"]
    assert main(["init", *files, "--out", str(tmp_path / "drafted.toml")]) == 0
    assert load_experiment(tmp_path / "drafted.toml").content.controller.limit == 9.0


def test_actuators_without_a_position_loop_leave_the_law_to_the_user(folder, tmp_path):
    motors = POSITIONS.replace("position", "motor", 1).replace(' kp="60" kv="2"', "")
    path = changed(folder, tmp_path, "", "", model_text(motors))
    files = [str(tmp_path / "log.csv"), "--robot", str(tmp_path / "robot.xml"), "--yes"]
    assert main(["init", *files, "--out", str(tmp_path / "drafted.toml")]) == 4
    text = " ".join((tmp_path / "drafted.toml").read_text().replace("# ", "").split())
    assert "actuator 'shoulder' is a motor" in text
    assert load_experiment(tmp_path / "drafted.toml").content.controller is None
    said = [r.message for r in check_experiment(path).remarks if r.kind == "actuators"]
    assert said and "Not all actuators of robot.xml hold a position" in said[0]


def test_a_fit_without_a_law_names_that_of_the_actuators(folder, tmp_path, capsys):
    text = (folder / "experiment.toml").read_text()
    table = text[text.index("[controller]") : text.index("[identify]")]
    path = changed(folder, tmp_path, table, "")
    assert main(["fit-simulator", str(path)]) == 1
    said = capsys.readouterr().err
    assert 'type = "pd"; kp = [60.0, 25.0]; kd = [2.0, 0.8]; speed_feed_forward = 0.0' in said


def test_logs_that_begin_in_motion_have_no_transient(folder, tmp_path):
    path = changed(folder, tmp_path, "", "")
    write_log(tmp_path / "log.csv", seconds=6.0, first=1.9)
    fit, _, judged = simulator_of(load_experiment(path), "mjcf", tmp_path / "out")
    assert_true(fit)
    rms = judged.rms()
    assert (fit.rms < 2e-4).all()
    # what is held out is judged no worse than what was fitted
    assert (rms["after"] < 2.0 * fit.rms).all()


def test_slow_transients_of_the_start_do_not_count(tmp_path, folder):
    """A weak drive forgets its start in seconds; the errors are those of the motion itself."""
    text = model_text(POSITIONS.replace('kp="60" kv="2"', 'kp="60" kv="0.05"'))
    text = text.replace('"shoulder" axis', '"shoulder" armature=".045" axis')
    text = text.replace('"elbow" axis', '"elbow" armature=".012" axis')
    little = {**TRUE, "damping": (0.05, 0.12), "frictionloss": (0.0, 0.0)}
    path = changed(folder, tmp_path, "kd = [2.0, 0.8]", "kd = [0.05, 0.8]", text)
    write_log(tmp_path / "log.csv", text, little)
    experiment = load_experiment(path)
    fit, _, judged = simulator_of(experiment, "mjcf", tmp_path / "out", ("damping",))
    assert (judged.rms()["after"] < 3.0 * fit.rms + 1e-4).all()
    assert judged.first == 438 and len(judged.q) == 876  # a half of the record, judged on a quarter


OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
PARTS = '<mujoco><asset><mesh name="m" file="m.obj" scale=".1 .1 .1"/></asset></mujoco>'
SHAPE = '<geom type="mesh" mesh="m" contype="0" conaffinity="0"/><geom size=".03"/>'


def with_meshes(folder, tmp_path, include=True):
    more = '<include file="parts.xml"/>' if include else PARTS[8:-9]
    text = model_text(compiler=' meshdir="shapes/coarse"', more=more, shape=SHAPE)
    path = changed(folder, tmp_path, "", "", text, seconds=2.0)
    (tmp_path / "shapes" / "coarse").mkdir(parents=True)
    (tmp_path / "shapes" / "coarse" / "m.obj").write_text(OBJ)
    (tmp_path / "parts.xml").write_text(PARTS)
    return path


@pytest.mark.parametrize(("include", "out"), [(True, "../results/of/links"), (False, "results")])
def test_meshes_of_a_subfolder_are_found_from_the_written_file(folder, tmp_path, include, out):
    place = tmp_path / "robot"
    place.mkdir()
    path = with_meshes(folder, place, include)
    assert main(["fit-simulator", str(path), "--free", "damping", "--out", str(place / out)]) == 0
    model = mujoco.MjModel.from_xml_path(str(place / out / "robot.xml"))
    assert model.nmesh == 1 and model.ngeom == 2
    values = json.loads((place / out / "simulator.json").read_text())
    damping = {v["joint"]: v["value"] for v in values["values"]}
    np.testing.assert_allclose(model.dof_damping, list(damping.values()), rtol=1e-5)
    assert max(values["held_out"]["rms"]["after"]) > 0.0


def test_missing_meshes_cost_their_shapes_and_no_fit(folder, tmp_path, capsys):
    path = with_meshes(folder, tmp_path)
    os.remove(tmp_path / "shapes" / "coarse" / "m.obj")
    assert main(["fit-simulator", str(path), "--free", "damping", "--held-out", "0"]) == 0
    said = capsys.readouterr().err
    assert said.index("meshes, materials and textures are left out") < said.index("pass 1")
    assert "m.obj" in said
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "experiment-simulator" / "robot.xml"))
    assert model.nmesh == 0 and model.ngeom == 1  # the sphere stays


def test_values_are_written_where_no_robot_file_can_be(folder, tmp_path, capsys, monkeypatch):
    def refused(*_):
        raise ValueError("plugin is not known")

    monkeypatch.setattr(mujoco.MjSpec, "to_xml", refused)
    path = changed(folder, tmp_path, "", "", seconds=2.0)
    out = tmp_path / "experiment-simulator"
    assert main(["fit-simulator", str(path), "--free", "damping", "--held-out", "0"]) == 0
    printed = capsys.readouterr()
    assert printed.err.index("only the values will be written") < printed.err.index("pass 1")
    assert "No robot's file is written: MuJoCo cannot write the file" in printed.out
    values = json.loads((out / "simulator.json").read_text())
    assert values["file"] is None and len(values["values"]) == 2
    assert any("plugin is not known" in text for text in values["findings"])
    assert not (out / "robot.xml").exists() and (out / "simulator.csv").exists()


def test_a_fit_that_is_worse_than_the_description_says_so(folder, tmp_path, capsys):
    """The log of the fit is of a robot that carries a load, the held-out one of that described."""
    text = model_text()
    for k, name in enumerate(("shoulder", "elbow")):
        values = " ".join(f'{quantity}="{own[k]}"' for quantity, own in TRUE.items())
        text = text.replace(f'name="{name}" axis', f'name="{name}" {values} axis')
    path = changed(folder, tmp_path, "", "", text)
    lines = path.read_text()
    table = lines[lines.index("[recording]") : lines.index("[controller]")]
    unseen = table.replace("[recording", "[validation.recording").replace("log.csv", "other.csv")
    unseen = unseen.replace("[validation.recording]", "[[validation.recording]]", 1)
    path.write_text(f"{lines}\n{unseen}")
    heavy = {**TRUE, "armature": (0.4, 0.2), "damping": (1.0, 1.0)}
    write_log(tmp_path / "log.csv", values=heavy, seconds=4.0)
    write_log(tmp_path / "other.csv", seconds=3.0)
    assert main(["fit-simulator", str(path)]) == 3
    assert "The fit is worse than the description on other (after): shoulder" in (
        capsys.readouterr().out
    )
    out = tmp_path / "experiment-simulator"
    values = json.loads((out / "simulator.json").read_text())
    assert any("worse than the description" in text for text in values["findings"])
    assert "worse than the description" in (out / "simulator.html").read_text()


def test_errors_of_the_same_size_are_not_worse(fitted):
    judged = fitted[2]
    same = replace(judged, after=judged.before, as_written=judged.before_own)
    assert isinstance(judged, HeldOut) and not same.findings()
    gone = replace(judged, after=np.full_like(judged.after, np.nan))
    assert "shoulder diverged in place of" in gone.findings()[0]
    assert not actuator_law(judged.robot.description, judged.robot.joint_names).reasons
