"""The public records: nothing is wrong with them that their descriptions do not say."""

from pathlib import Path

import pytest

from pivident.data.logs.described_log import described_log
from pivident.experiment.check.audit_file import audit_file
from pivident.judgement.audit.audit import audit_log
from tests.judgement.audit.logs import serious

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"

pytestmark = [pytest.mark.record, pytest.mark.usefixtures("public_data")]


def test_staubli_tx40():
    (audit,) = audit_file(EXAMPLES / "staubli_tx40" / "experiment.toml")
    # Five significant digits round motor positions of more than 10 rad.
    assert serious(audit) == {("warning", "digits", f"q of joint_{j}") for j in range(1, 7)}
    steps = {g.name: g.step for g in audit.quantisation.grids}
    for joint in (1, 2):
        assert steps[f"q of joint_{joint}"] == pytest.approx(3.196e-5, rel=1e-3)
    for joint in (3, 4, 5, 6):
        assert steps[f"q of joint_{joint}"] == pytest.approx(9.587e-5, rel=1e-3)
    assert abs(audit.delay.common[0]) < 2e-3
    assert audit.excitation.rank == 61


def test_emps():
    (audit,) = audit_file(EXAMPLES / "emps" / "experiment.toml")
    assert serious(audit) == set()
    assert abs(audit.delay.common[0]) < 0.1e-3 and audit.delay.common[1] < 0.05e-3
    assert audit.scale.factors[0] == pytest.approx(1.0, abs=0.01)


def test_kuka_kr300():
    audits = audit_file(EXAMPLES / "kuka_kr300" / "experiment.toml")
    for audit in audits:
        assert audit.severity == "warning"
        # A hydraulic counterbalance, which the description does not have, carries axis 2.
        assert ("warning", "gain", "joint_2") in serious(audit)


def test_tiago(data_dir):
    folder = data_dir / "tiago"
    joints = ["torso_lift", *(f"arm_{j}" for j in range(1, 8))]
    files = {
        kind: folder / f"tiago_{name}.csv.gz"
        for kind, name in (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    }
    columns = {
        kind: [f"- {j}_joint_{name}" for j in joints]
        for kind, name in (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    }
    log = described_log(files, columns | {"t": {"file": "q", "columns": "t"}}, joint_names=joints)
    audit = audit_log(log)
    found = serious(audit)
    assert {("error", "stuck", f"tau of arm_{j}") for j in (5, 6, 7)} <= found
    assert ("error", "jitter", "t") in found
    # The logged speed is the position's derivative behind a filter of 0.95 and 0.05.
    assert {("warning", "derivative", f"dq of {j}") for j in joints[1:5]} <= found
