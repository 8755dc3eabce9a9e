"""Fitted simulations in identification.json: they come back, and damaged values are refused."""

import json

import numpy as np
import pytest

from pivident.estimation.identification_file import save_identification, to_dict
from pivident.estimation.stored_identification import load_identification
from pivident.estimation.summary import identification_table
from pivident.foundation.errors import IdentificationFileError
from pivident.judgement.report.builder import render_report
from tests.planar_simulations import simulated_results


@pytest.mark.parametrize("name", ["cloe", "ml", "oloe"])
def test_simulations_come_back(tmp_path, name):
    result = simulated_results()[name]
    save_identification(result, tmp_path)
    loaded = load_identification(tmp_path)
    own, back = result.simulation, loaded.simulation
    assert back.fit is None and back.loop_parameters == own.loop_parameters
    assert (back.compares, back.loop, back.held) == (own.compares, own.loop, own.held)
    assert (back.at_bound, back.noise_orders) == (own.at_bound, own.noise_orders)
    np.testing.assert_array_equal(back.position_rms, own.position_rms)
    np.testing.assert_array_equal(back.torque_rms, own.torque_rms)  # NaN in open loop
    kept = [line for line in identification_table(result).splitlines() if "Simulation" in line]
    assert kept and all(line in identification_table(loaded) for line in kept)
    page = render_report([loaded])
    assert 'id="simulation"' in page and "Simulation errors, " in page


def damaged(tmp_path, change):
    content = to_dict(simulated_results()["cloe"])
    change(content["simulation"])
    (tmp_path / "identification.json").write_text(json.dumps(content), encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    "change",
    [
        lambda s: s.update(compares="speeds"),
        lambda s: s.update(loop="half"),
        lambda s: s.update(position_rms=[1e-6]),
        lambda s: s.update(position_rms=[1e-6, -1e-6]),
        lambda s: s.update(torque_rms=["much", 1.0]),
        lambda s: s.pop("held"),
        lambda s: s.update(loop_parameters=[{"name": "kp1"}]),
        lambda s: s.update(loop_parameters=7),
        lambda s: s["loop_parameters"][0].update(std=-1.0),
        lambda s: s["loop_parameters"][0].update(value=None),
        lambda s: s["loop_parameters"][0].update(bound="side"),
        lambda s: s["loop_parameters"][0].update(held="no"),
        lambda s: s.update(noise_orders=["ten"]),
    ],
)
def test_damaged_simulations_are_refused(tmp_path, change):
    with pytest.raises(IdentificationFileError, match="simulation"):
        load_identification(damaged(tmp_path, change))


def test_undamaged_ones_are_not(tmp_path):
    assert load_identification(damaged(tmp_path, lambda s: None)).simulation.compares == "positions"
