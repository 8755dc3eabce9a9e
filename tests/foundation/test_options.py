"""Options that are declared once."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest

from pivident.foundation.errors import ExperimentError
from pivident.foundation.options import (
    Option,
    Options,
    choices_of,
    declarations,
    option,
    per_joint,
)


@dataclass(frozen=True)
class Cloud(Options):
    """Options of many kinds."""

    particles: int = option(500, "how many", at_least=10)
    discount: float = option(0.9, "what counts", above=0.5, below=1.0)
    spread: float | None = option(None, "first deviation", above=0.0)
    loss: Literal["huber", "bisquare"] = option("huber", "loss")
    band: Literal["auto"] | float = option("auto", "band", unit="Hz", at_least=0.0)
    rooted: bool = option(False, "whether factors are carried")
    noise: float | tuple[float, ...] | None = option(None, "of each joint", above=0.0)


def test_declarations_stand_with_the_fields():
    assert list(declarations(Cloud)) == [
        "particles", "discount", "spread", "loss", "band", "rooted", "noise",
    ]  # fmt: skip
    assert declarations(Cloud)["particles"] == Option("how many", at_least=10)
    assert choices_of(Cloud, "loss") == ("huber", "bisquare")
    assert choices_of(Cloud, "rooted") == (True, False)
    assert choices_of(Cloud, "band") == ("auto",)
    assert Cloud().particles == 500


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("particles", 9, "particles is 9; at least 10"),
        ("discount", 0.5, "discount is 0.5; it lies between 0.5 and 1"),
        ("discount", float("nan"), "discount is nan; it lies between 0.5 and 1"),
        ("spread", 0.0, "spread is 0.0; it has to be positive"),
        ("spread", float("inf"), "spread is inf; it has to be positive"),
        ("loss", "cauchy", "loss is 'cauchy'; choose one of 'huber', 'bisquare'"),
        ("band", "none", "band is 'none'; choose one of 'auto'"),
        ("band", -1.0, "band is -1.0; zero or more"),
        ("rooted", "yes", "rooted is 'yes'; choose one of True, False"),
        ("rooted", 1, "rooted is 1; true or false"),
        ("noise", (1.0, 0.0), "noise is 0.0; it has to be positive"),
    ],
)
def test_values_outside_their_limits_are_refused_by_name(name, value, sentence):
    with pytest.raises(ExperimentError) as error:
        Cloud(**{name: value})
    assert str(error.value) == sentence
    assert error.value.place == (name,)


def test_values_within_their_limits_are_taken():
    made = Cloud(particles=10, discount=0.6, band=20.0, rooted=True, noise=(1.0, 2.0))
    assert made.noise == (1.0, 2.0)


@pytest.mark.parametrize("given", [3.0, [3.0, 3.0], (3, 3)])
def test_one_number_for_all_joints_or_one_for_each(given):
    made = per_joint("limit", given, 2)
    np.testing.assert_array_equal(made, [3.0, 3.0])
    made[0] = 0.0  # a copy


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ([1.0], "limit has 1 number for 2 joints"),
        ([1.0, 2.0, 3.0], "limit has 3 numbers for 2 joints"),
    ],
)
def test_numbers_for_other_joints_are_refused(given, sentence):
    with pytest.raises(ExperimentError, match=sentence) as refused:
        per_joint("limit", given, 2)
    assert refused.value.place == ("limit",)
