"""The TX40 in the three sizes of its base set, and reference values of its dynamics."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.parameters import standard_parameters
from pivident.robot.friction import FrictionLaw, coulomb, viscous
from pivident.robot.gallery import load_robot


@pytest.fixture(scope="session")
def tx40():
    """The gallery's TX40: friction with offsets, coupling with its rotor inertia."""
    return load_robot("staubli_tx40")


@pytest.fixture(scope="session")
def tx40_without_iam6(tx40):
    """With offsets, without the coupled rotor inertia."""
    return replace(tx40, couplings=tuple(replace(c, inertia=False) for c in tx40.couplings))


@pytest.fixture(scope="session")
def tx40_of_the_reference(tx40_without_iam6):
    """Without offsets: the model that the reference values belong to."""
    return tx40_without_iam6.with_friction(FrictionLaw((viscous(), coulomb("atan", 150.0))))


@pytest.fixture(scope="session")
def reference(reference_dir):
    """Random states of the TX40 by an independent implementation."""
    return json.loads((reference_dir / "tx40_dynamics.json").read_text())


@pytest.fixture(scope="session")
def reference_theta(reference, tx40_of_the_reference):
    """Standard parameters of the reference, in our order."""
    by_name = {name.lower(): value for name, value in reference["standard_parameters"].items()}
    parameters = standard_parameters(tx40_of_the_reference)
    assert {p.name for p in parameters} == set(by_name)
    return np.array([by_name[p.name] for p in parameters])


@pytest.fixture(scope="session")
def reference_states(reference):
    """``q dq ddq tau`` of the reference, each (states, joints)."""
    return tuple(np.array(reference[key]) for key in ("q", "dq", "ddq", "tau"))
