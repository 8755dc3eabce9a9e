"""Units of positions in messages are those of the joint, where it is known."""

import numpy as np
import pytest

from pivident.data.logs.log import Log
from pivident.judgement.audit.standstill import check_standstill
from tests.judgement.audit.scara import arm


@pytest.fixture
def still():
    """A slide that moves by 2 mm beside two turning joints."""
    q = np.outer(np.sin(np.linspace(0.0, 9.0, 500)), [1.0, 1.0, 0.001])
    return Log("log", ("turn", "elbow", "slide"), {}, {}, channels={"q": q}, robot=arm("0 0 1"))


def test_a_slide_stands_still_in_millimetres(still):
    (finding,) = check_standstill(still)
    assert finding.subject == "slide" and finding.quantity.unit == "mm"
    assert "slide moves by 2 mm in the whole record" in finding.message


def test_without_a_description_both_units_are_possible(still):
    bare = Log("log", still.joint_names, {}, {}, channels=still.channels)
    (finding,) = check_standstill(bare)
    assert "slide moves by 2 mrad (or mm) in the whole record" in finding.message
    assert bare.position_unit(0) == "rad (or m)"
    assert [still.position_unit(j) for j in range(3)] == ["rad", "rad", "m"]
