"""Warnings of an estimate with the numbers behind them, written and read."""

from dataclasses import replace

from pivident.estimation.stored_identification import load_identification
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.repair import Edit, Repair
from tests.synthetic_identification import synthetic_identification


def test_intervals_come_back(tmp_path):
    """A friction below zero is stored with its interval; such results could not be loaded."""
    size = {"fc1": Quantity(-0.2, "N m", bound=0.0, interval=(-0.5, 0.1))}
    warning = Finding("warning", "physics", "negative", "fc1 is negative.", evidence=size)
    replace(synthetic_identification(), warnings=(warning,)).save(tmp_path)
    assert load_identification(tmp_path).warnings == (warning,)


def test_places_come_back(tmp_path):
    """Where a warning is about a key of the experiment file; such results could not be loaded."""
    place = ("recording", 0, "units", "tau")
    warning = Finding("warning", "methods", "median", "It acts on ls only.", place=place)
    repair = Repair((Edit(("identify", "bandpass", "median"), 1),))
    made = replace(
        synthetic_identification(), warnings=(warning, replace(warning, repairs=(repair,)))
    )
    made.save(tmp_path)
    assert load_identification(tmp_path).warnings == (warning, warning)
