"""Which joints' gains the masses of a description can tell."""

import numpy as np
import pytest

from pivident.judgement.audit.description_factors import description_factors
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.recording_audit import log_of
from pivident.judgement.audit.timing import check_timing
from tests.judgement.audit.scara import arm, recording


@pytest.mark.parametrize("slide", ["0 0 1", "0 0 -1"])
def test_weight_and_mass_of_a_vertical_slide_are_an_offset_and_a_rotor(slide):
    gain = np.array([8.0, 5.0, 60.0])
    log = log_of(arm(slide), recording(arm(slide), gain))
    factors = description_factors(log, build_inverse_model(log, check_timing(log))).factors
    np.testing.assert_allclose(factors[:2] * gain[:2], 1.0, atol=0.02)
    assert np.isnan(factors[2])


def test_a_slide_that_is_turned_about_the_vertical_has_a_gain():
    gain = np.array([8.0, 5.0, 60.0])
    log = log_of(
        arm("1 0 0"), recording(arm("1 0 0"), gain)
    )  # carried around, it is pulled outwards
    factors = description_factors(log, build_inverse_model(log, check_timing(log))).factors
    np.testing.assert_allclose(factors * gain, 1.0, atol=0.05)
