"""Options of filters in experiment files, and what has no use for filters."""

import pytest

from pivident.estimation.literature.filters.kalman_filters import (
    CentralDifferenceKalman,
    ExtendedKalman,
    UnscentedKalman,
)
from pivident.estimation.literature.filters.particle_filter import Particles
from pivident.experiment.identify_table import IdentifyEntry, method_of
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.studies.friction_laws.law_choice import choose_laws
from pivident.studies.friction_laws.shapes import identify_shapes
from tests.estimation.literature.filters.scenes import planar_problem


def test_files_have_the_options_of_filters():
    entry = IdentifyEntry.model_validate(
        {
            "ekf": {"drift": 0.01, "torque_noise": [0.1, 0.2], "passes": 2},
            "ukf": {"alpha": 0.5, "square_root": True, "start": "initial"},
            "cdkf": {"step": 2.0, "spread": 5.0},
            "particle": {"particles": 100, "seed": 3, "discount": 0.95},
        }
    )
    assert method_of("ekf", entry) == ExtendedKalman(drift=0.01, torque_noise=(0.1, 0.2), passes=2)
    assert method_of("ukf", entry) == UnscentedKalman(alpha=0.5, square_root=True, start="initial")
    assert method_of("cdkf", entry) == CentralDifferenceKalman(step=2.0, spread=5.0)
    assert method_of("particle", entry) == Particles(particles=100, seed=3, discount=0.95)


def test_unknown_options_are_refused():
    with pytest.raises(ValueError, match="alpha"):
        IdentifyEntry.model_validate({"ekf": {"alpha": 0.5}})
    with pytest.raises(ValueError, match="particles"):
        IdentifyEntry.model_validate({"particle": {"particles": 1}})


def test_laws_and_constants_of_friction_are_left_to_others():
    problem, _ = planar_problem(samples=800)
    with pytest.raises(IdentificationError, match="not by EKF"):
        choose_laws(problem, method="ekf")
    with pytest.raises((IdentificationError, ExperimentError), match="EKF has no equations"):
        identify_shapes(problem, "ekf")
