from dataclasses import replace

import numpy as np
import pytest

from pivident.studies.excitation.account import broken, hardest
from pivident.studies.excitation.design import PredictedError
from tests.studies.excitation.designs import made_design


@pytest.mark.parametrize("robot", ["planar_2r", "staubli_tx40"])
@pytest.mark.parametrize("kind", ["fourier", "splines", "postures"])
def test_the_account_is_short_and_has_what_decides(robot, kind):
    design = made_design(robot, kind)
    text = str(design)
    lines = text.splitlines()
    assert 15 <= len(lines) <= 40 and max(map(len, lines)) <= 100
    assert "largest relative standard error 0.0340 (start" in " ".join(lines)
    assert "at the start 1240" in text
    assert f"{len(design.predicted) - 1} of {len(design.predicted)} parameters" in text
    assert "22.3 mm apart at 1.37 s, 20.0 mm needed" in text
    assert "its column vanishes" in text
    assert "98 % of its limit" in text


def test_wanted_parameters_come_first_then_the_least_certain():
    design = made_design("staubli_tx40")
    found = hardest(design, 100)
    wanted = [p.wanted for p in found]
    assert wanted == sorted(wanted, reverse=True) and sum(wanted) == 2
    relative = [p.share for p in found if not p.wanted]
    known = [x for x in relative if np.isfinite(x)]
    assert known == sorted(known, reverse=True)
    assert all(np.isfinite(p.std) for p in found)


def test_a_limit_that_is_not_kept_is_loud():
    design = made_design()
    assert broken(design) == ()
    use = replace(design.limits[1], largest=1.2 * design.limits[1].high)
    near = replace(design.clearances[0], least=0.01)
    wrong = replace(design, limits=(design.limits[0], use), clearances=(near,))
    assert broken(wrong) == (use, near)
    text = str(wrong)
    assert "LIMITS THAT ARE NOT KEPT: 2" in text and "speed of shoulder: 120 % of its" in text
    assert text.count("forearm and table") == 1  # not among those that only bind


def test_controls_do_not_reach_the_terminal():
    own = PredictedError("a\x1b[31m", "kg", 1.0, 0.1, np.inf)
    assert "\x1b" not in str(replace(made_design(), predicted=(own,), correlation=np.eye(1)))
