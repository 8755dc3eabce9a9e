"""Bodies that no machine has, and who says so before their masses are used."""

import numpy as np
import pytest

from pivident.app.cli.app import main
from pivident.experiment.check.robot_check import check_bodies
from pivident.robot import parse_urdf

INERTIA = '<inertia ixx="{xx}" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>'


def arm(masses=(6.0, 5.0, 3.0, 2.0), xx="0.01") -> str:
    """Four links on hinges of 0.2 m; the last one's first moment of inertia."""
    links = "".join(
        f'<link name="l{k}"><inertial><mass value="{m}"/><origin xyz="0.1 0 0"/>'
        f"{INERTIA.format(xx=xx if k == 3 else 0.01)}</inertial></link>"
        for k, m in enumerate(masses)
    )
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="{"base" if k == 0 else f"l{k - 1}"}"/>'
        f'<child link="l{k}"/><origin xyz="0.2 0 0" rpy="{k % 2} 0 0"/><axis xyz="0 0 1"/>'
        f'<limit lower="-2" upper="2" effort="90" velocity="2"/></joint>'
        for k in range(4)
    )
    return f'<robot name="arm"><link name="base"/>{links}{joints}</robot>'


def said(text: str) -> list[str]:
    return [finding.message for finding in check_bodies(parse_urdf(text), "arm.urdf")]


def test_a_link_that_outweighs_its_arm_is_named():
    (message,) = said(arm((2.0, 2.0, 1.0, 30.0)))
    assert "link l3 in arm.urdf is 30 kg, that of all others together 5 kg" in message


@pytest.mark.parametrize("masses", [(6.0, 5.0, 3.0, 2.0), (40.0, 5.0, 3.0, 2.0), (5, 5, 5, 20)])
def test_a_heavy_pedestal_and_a_heavy_tool_are_usual(masses):
    assert said(arm(masses)) == []


@pytest.mark.parametrize(
    ("xx", "words"),
    [("-0.01", "is not positive definite"), ("1.676", "one is larger than the two others")],
)
def test_commands_name_an_impossible_body_before_they_use_it(
    tmp_path, capsys, monkeypatch, xx, words
):
    """A lost decimal point, and the parallel axis theorem the wrong way round."""
    (tmp_path / "arm.urdf").write_text(arm(xx=xx))
    t = np.arange(400) / 100.0
    columns = [t, *(np.sin(t + k) for k in range(4)), *(np.cos(t + k) for k in range(4))]
    header = ",".join(["time", *(f"{s}{k}" for s in ("q", "tau") for k in range(4))])
    np.savetxt(tmp_path / "log.csv", np.stack(columns, 1), "%.9f", ",", header=header, comments="")
    lists = {s: [f"{s}{k}" for k in range(4)] for s in ("q", "tau")}
    log = f'files = "log.csv"\ncolumns = {{t = "time", q = {lists["q"]}, tau = {lists["tau"]}}}\n'
    text = f'robot = "arm.urdf"\n[recording]\n{log}[[payload.recording]]\nname = "load"\n{log}'
    (tmp_path / "e.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    urdf, file = str(tmp_path / "arm.urdf"), str(tmp_path / "e.toml")
    for command in (
        ["excite", urdf, "--seconds", "0.2", "--duration", "4", "--out", str(tmp_path / "m")],
        ["payload", file],
        ["predict", urdf, file],
        ["gains", file],
        ["fit-simulator", file],
        ["check", file],
    ):
        main(command)
        written = "".join(capsys.readouterr())
        assert "of link l3 in arm.urdf" in written and words in written, command
