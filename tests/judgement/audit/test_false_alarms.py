"""A clean log raises no alarm. The larger count is in benchmarks/audit_alarms.py."""

import pytest

from pivident.judgement.audit.audit import audit_log
from tests.judgement.audit.logs import planar, serious, tx40


@pytest.mark.parametrize("seed", range(100, 108))
def test_planar_arm(seed):
    assert serious(audit_log(planar(seed))) == set()


@pytest.mark.parametrize("seed", (100, 101))
def test_six_axes(seed):
    assert serious(audit_log(tx40(seed, seconds=4.0))) == set()
