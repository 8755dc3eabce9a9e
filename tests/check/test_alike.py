"""What holds of several joints is said once, and no number is lost."""

from pivident.audit.finding import Finding, alike, grouped
from pivident.check.remark import Remark
from pivident.check.remark import grouped as joined


def speed(joint, factor, step="Check the units of dq_ref and q_ref."):
    text = f"dq_ref of {joint} is {factor:.4g} times the derivative of q_ref."
    return Finding("wrong", "speed", "derivative", text, f"dq_ref of {joint}", step, value=factor)


def test_a_finding_of_many_joints_names_them_with_their_numbers():
    ((severity, sentence, step),) = grouped([speed(f"joint_{j}", 57.3 + j) for j in (1, 2, 3)])
    assert severity == "wrong" and step == "Check the units of dq_ref and q_ref."
    assert sentence == (
        "dq_ref of joint_1 is 58.3 times the derivative of q_ref. "
        "The same for dq_ref of joint_2 (59.3), dq_ref of joint_3 (60.3)."
    )


def test_another_step_is_another_finding():
    assert len(grouped([speed("elbow", 57.0), speed("wrist", 1.3, "It was filtered.")])) == 2


def test_numbers_in_the_name_of_another_joint_are_no_amounts():
    findings = [speed(f"zz{j}", 57.0, f"Accelerate arm_{j}_joint harder.") for j in (2, 3)]
    assert [step for _, _, step in grouped(findings)] == [f.step for f in findings]


def test_numbers_that_no_amount_tells_keep_remarks_apart():
    remarks = [
        Remark("look", "robot", "mass", f"The mass of {joint} is {mass} kg.", "", joint)
        for joint, mass in (("elbow", 2), ("wrist", 2), ("tool", 3))
    ]
    assert [r.sentence for r in joined(remarks)] == [
        "The mass of elbow is 2 kg. The same for wrist.",
        "The mass of tool is 3 kg.",
    ]


def test_what_is_changed_elsewhere_and_what_has_no_name_stands_alone():
    places = [("recording", 0, "units"), ("recording", 1, "units")]
    remarks = [Remark("look", "a", "b", "The same.", "", "elbow", place) for place in places]
    assert len(alike(remarks)) == 2
    assert len(alike([Remark("look", "a", "b", "The same.") for _ in range(2)])) == 2
