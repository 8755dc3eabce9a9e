"""Parameters that may be zero: which of them matter, and which make no torque in any case."""

import dataclasses

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.experiment.simulated_tx40 import tx40_fine
from pivident.judgement.diagnostics.estimate_statements import determined, open_parameters
from pivident.judgement.diagnostics.slight_terms import torque_shares
from tests.planar_results import planar_results


@pytest.fixture(scope="module")
def fitted():
    return identify(tx40_fine(samples=8000)[0], "ls")


def with_estimate(result, name, value, std):
    """A result whose estimate of one parameter is another."""
    k, theta = result.names.index(name), result.theta.copy()
    robust = result.robust_covariance.copy()
    robust[k], robust[:, k] = 0.0, 0.0
    theta[k], robust[k, k] = value, std**2
    return dataclasses.replace(result, judged=None, theta=theta, robust_covariance=robust)


def test_the_share_of_coulomb_friction_is_its_value_over_the_torque(fitted):
    """Its column is ±1: in a record at rest afterwards only full motion counts, whose torque is."""
    result = with_estimate(fitted, "fc2", 0.1, 0.2)
    some = np.unique(np.linspace(0, len(result.recordings[0].q) - 1, 400).astype(int))
    (record,) = result.recordings
    torque = result.predict(record.q[some], record.dq[some], record.ddq[some])[:, 1]
    in_record = 0.5 / np.sqrt(np.mean(torque**2))
    (share,) = torque_shares(result, ["fc2"])
    slower = dataclasses.replace(record, dq=0.0 * record.dq, ddq=0.0 * record.ddq)
    (in_full,) = torque_shares(dataclasses.replace(result, recordings=(slower,)), ["fc2"])
    assert share == pytest.approx(max(in_record, in_full), rel=0.05)


def test_a_parameter_of_no_consequence_needs_no_motion(fitted):
    small = with_estimate(fitted, "fv4", 1e-5, 1e-4)
    (share,) = torque_shares(small, ["fv4"])
    assert 0.0 < share < 0.01
    said = [finding.message for finding in determined(small)]
    assert "of no consequence (zero within 2σ, less than 1 % of any joint's torque): fv4" in said[0]
    assert not any(text.startswith("For ") and "fv4" in text for text in said)
    assert "fv4" not in open_parameters(small)


def test_no_motion_is_asked_for_an_offset():
    """Its torque is the same in every motion; a parameter that is not known is still asked for."""
    (found,) = planar_results("piv")
    for value in (0.0, 10.0):  # zero within its interval, or half known
        doubtful = with_estimate(with_estimate(found, "fv2", 1.0, 0.2), "off1", value, 4.0)
        said = [finding.message for finding in determined(doubtful)]
        assert "off1" in said[0]
        assert any("fv2" in text for text in said[1:]) == ("fv2" in open_parameters(doubtful))
        assert "fv2" in open_parameters(doubtful) and "off1" not in open_parameters(doubtful)
        assert not any("off1" in text for text in said[1:])


def test_one_that_may_make_much_torque_is_open(fitted):
    wide = with_estimate(fitted, "fv4", 0.1, 1.0)
    (share,) = torque_shares(wide, ["fv4"])
    assert share > 0.1
    said = [finding.message for finding in determined(wide)]
    assert "fv4" in said[0].split("not significantly different from zero: ")[1]
    assert any(text.startswith("For ") and "fv4" in text for text in said[1:])
    assert "fv4" in open_parameters(wide)


def test_what_is_slight_in_the_record_alone_is_not_slight(fitted):
    """Gravity of a joint that hardly moved makes little torque there and much elsewhere."""
    still = [
        dataclasses.replace(r, q=0.0 * r.q, dq=0.001 * r.dq, ddq=0.001 * r.ddq)
        for r in fitted.recordings
    ]
    name = next(n for n in fitted.names if n.startswith("fc3"))
    quiet = dataclasses.replace(fitted, recordings=tuple(still))
    assert torque_shares(quiet, [name])[0] > 0.01


def test_without_a_record_nothing_is_known(fitted):
    without = dataclasses.replace(fitted, recordings=())
    assert np.isnan(torque_shares(without, ["fv4"])).all()
    wide = with_estimate(without, "fv4", 1e-5, 1e-4)
    assert "fv4" in open_parameters(wide)
