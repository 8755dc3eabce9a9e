"""Findings: order, counts, and those of several joints as one, without a number lost."""

from pivident.experiment.check.remark import Remark
from pivident.foundation.text.finding import (
    Finding,
    Quantity,
    at_sample,
    counted,
    merged,
    serious,
    worst,
)


def speed(joint, factor, step="Check the units of dq_ref and q_ref."):
    text = f"dq_ref of {joint} is {factor:.4g} times the derivative of q_ref."
    evidence = {"factor": Quantity(factor), **at_sample(12, 0.1)}
    return Finding("error", "speed", "derivative", text, f"dq_ref of {joint}", step, evidence)


def mass(joint, kg, **changes):
    text = f"The mass of {joint} is {kg} kg."
    evidence = {"mass": Quantity(kg, "kg")}
    return Remark("warning", "robot", "mass", text, joint, evidence=evidence, **changes)


def test_a_finding_of_many_joints_names_them_with_their_numbers():
    (found,) = serious([speed(f"joint_{j}", 57.3 + j) for j in (1, 2, 3)])
    assert found.severity == "error" and found.next_step == "Check the units of dq_ref and q_ref."
    assert found.message == (
        "dq_ref of joint_1 is 58.3 times the derivative of q_ref. "
        "The same for dq_ref of joint_2 (59.3), dq_ref of joint_3 (60.3)."
    )


def test_another_step_is_another_finding():
    assert len(serious([speed("elbow", 57.0), speed("wrist", 1.3, "It was filtered.")])) == 2


def test_numbers_in_the_name_of_another_joint_keep_steps_apart():
    findings = [speed(f"zz{j}", 57.0, f"Accelerate arm_{j}_joint harder.") for j in (2, 3)]
    assert [f.next_step for f in serious(findings)] == [f.next_step for f in findings]


def test_each_joint_keeps_its_own_number():
    (found,) = merged([mass("elbow", 2), mass("wrist", 2), mass("tool", 3)])
    assert found.message == "The mass of elbow is 2 kg. The same for wrist (2 kg), tool (3 kg)."


def test_several_numbers_are_named():
    findings = [
        Finding(
            "error", "a", "gain", f"{j}.", j, evidence={"file": Quantity(1), "log": Quantity(k)}
        )
        for k, j in enumerate(("elbow", "wrist"))
    ]
    assert merged(findings)[0].message == "elbow. The same for wrist (file 1, log 1)."


def test_what_has_no_number_and_no_kind_in_common_stands_alone():
    kinds = [Finding("error", "columns", k, "The same.", "elbow") for k in ("read", "used")]
    assert merged(kinds) == kinds


def test_what_is_changed_elsewhere_and_what_has_no_name_stands_alone():
    places = [("recording", 0, "units"), ("recording", 1, "units")]
    assert len(merged([mass("elbow", 2, place=place) for place in places])) == 2
    assert len(merged([Remark("warning", "a", "b", "The same.") for _ in range(2)])) == 2


def test_the_gravest_comes_first_and_is_counted():
    findings = [mass("elbow", 2), Finding("ok", "a", "b", "Good."), speed("wrist", 57.0)]
    assert [f.severity for f in serious(findings)] == ["error", "warning"]
    assert worst(findings) == "error" and worst([]) == "ok"
    assert counted(findings) == "1 error, 1 warning"
    assert counted([]) == "0 errors, 0 warnings"


def test_a_quantity_keeps_its_interval_and_unit():
    assert str(Quantity(2.5, "kg", interval=(2.4, 2.6))) == "2.50 ± 0.10 kg"
    assert str(Quantity(2.5, "unit of the file")) == "2.5"


def test_json_holds_every_field_and_no_nan():
    content = speed("elbow", float("nan")).as_json()
    assert content["evidence"]["factor"]["value"] is None
    assert content["evidence"]["sample"]["value"] == 12
    assert content["subject"] == "dq_ref of elbow" and content["severity"] == "error"
