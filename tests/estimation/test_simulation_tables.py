"""Tables of fitted simulations: errors by joint, unknowns of the loop with their intervals."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.simulation_result import LoopParameter, SimulationResult
from pivident.estimation.summary import (
    comparison_table,
    identification_table,
    parameter_texts,
    simulation_text,
)
from pivident.studies.tables.identifications import identification_iterations
from tests.planar_simulations import simulated_results
from tests.synthetic_identification import synthetic_identification


def made(**changes) -> SimulationResult:
    return SimulationResult(
        compares="positions", loop="closed",
        position_rms=np.array([1.25e-5, 3.5e-6]), torque_rms=np.array([0.75, np.nan]), **changes,
    )  # fmt: skip


def test_table_has_the_errors_with_their_units():
    text = simulation_text(synthetic_identification(method="CLOE", simulation=made()))
    lines = text.splitlines()
    assert "closed loop" in lines[0] and "positions" in lines[0]
    assert lines[1].split() == ["joint", "position", "rms", "unit", "torque", "rms", "unit"]
    assert lines[2].split()[1:] == ["1.25e-05", "rad", "0.750", "N", "m"]
    assert lines[3].split()[1:] == ["3.50e-06", "rad", "–", "N", "m"]


def test_other_methods_have_no_such_table():
    plain = synthetic_identification()
    assert simulation_text(plain) == ""
    assert "Simulation" not in identification_table(plain)


@pytest.mark.parametrize(
    ("bound", "expected", "interval"),
    [
        ("", "0.0040", (0.1212, 0.1292)),
        ("low", "+0.0040, at its lower bound", (0.1252, 0.1292)),
        ("high", "−0.0040, at its upper bound", (0.1212, 0.1252)),
    ],
)
def test_intervals_have_one_side_at_a_bound(bound, expected, interval):
    parameter = LoopParameter("kp1", "1/s", 0.1252, 0.0020, bound)
    assert parameter_texts(parameter) == ("0.1252", expected)
    assert parameter.interval(0.954499736) == pytest.approx(interval, abs=1e-9)


def test_what_was_held_has_no_standard_error():
    parameter = LoopParameter("delay", "s", 0.002, 0.0, held=True)
    assert parameter_texts(parameter)[1] == "held"
    names = synthetic_identification().names
    result = synthetic_identification(simulation=made(held=(names[1],)))
    row = parameter_rows(result)[1]
    assert np.isnan(row.std) and not row.includes_zero
    assert f"does not determine them: {names[1]}" in " ".join(
        simulation_text(result).replace("do not", "does not").split()
    )


def test_gains_of_a_fit_are_in_the_tables_of_its_result():
    results = simulated_results()
    text = identification_table(results["cloe"])
    (kp,) = [line for line in text.splitlines() if line.startswith("kp1 ")]
    value, spread = map(float, kp.split()[1:3])
    assert abs(value - 6000.0) < 2.0 * spread  # the law of the simulated record
    together = comparison_table([results["piv"], results["cloe"], results["oloe"]])
    assert "\nCLOE\nSimulation in closed loop" in together
    assert "\nOLOE\nSimulation in open loop" in together and "\nIDIM-PIV\nSim" not in together


def test_weighted_errors_are_not_called_torque_errors():
    result = simulated_results()["ml"]
    columns = identification_iterations(result).columns
    assert "weighted_error_percent" in columns and "relative_error_percent" not in columns
    assert columns["weighted_error_percent"][-1] == pytest.approx(100.0, rel=0.05)
    plain = identification_iterations(replace(result, simulation=None)).columns
    assert "relative_error_percent" in plain
