"""Columns are given to the joints that they belong to."""

from pathlib import Path

import numpy as np
import pytest

from pivident.data.logs.recognition.log_clock import column_series
from pivident.data.logs.recognition.log_file import LogFile, Run, joint_map


def mapped(names, joints):
    """Column of each joint's position, from the names of a table's columns."""
    noise = np.random.default_rng(0)
    columns = {name: noise.normal(size=50) for name in names}
    series = tuple(column_series(list(columns), joints))
    found = joint_map(Run((LogFile(Path("log.csv"), columns, series),)), joints)
    return {kind: dict(channel.columns) for kind, channel in found.channels.items()}


@pytest.mark.parametrize("first", [0, 1])
def test_numbers_go_to_the_joints_of_these_numbers(first):
    names = [f"{kind}_{k + first}" for kind in ("q", "tau") for k in range(3)]
    found = mapped(["t", *names], ("leg_3", "leg_1", "leg_2"))
    assert found["q"] == {f"leg_{k + 1}": f"q_{k + first}" for k in range(3)}
    assert found["tau"] == {f"leg_{k + 1}": f"tau_{k + first}" for k in range(3)}


def test_numbers_count_from_the_base_where_joints_have_none():
    names = ["t", "q_1", "q_2", "tau_1", "tau_2"]
    assert mapped(names, ("waist", "elbow"))["q"] == {"waist": "q_1", "elbow": "q_2"}
