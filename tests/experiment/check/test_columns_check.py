"""What the names of columns betray, and what they do not."""

from pivident.experiment.check.columns_check import check_columns


def told(columns, units=None):
    return [(r.kind, r.subject) for r in check_columns(columns, units or {}, None)]


def test_the_letter_of_an_axis_is_no_unit():
    columns = {"q": ["A1", "A2"], "tau": ["A1_torque", "A2_torque"]}
    assert told(columns, {"q": "deg", "tau": "N m"}) == []


def test_a_letter_of_its_own_is_a_unit():
    assert told({"tau": ["torque1 [A]", "torque2 [A]"]}) == [("unit", "torque1 [A]")]
    assert told({"tau": ["motor_current_1"]}, {"tau": "N m"}) == [("unit", "motor_current_1")]


def test_units_of_time_are_those_that_a_draft_knows():
    assert told({"t": "time_msec"}) == [("unit", "time_msec")]
    assert told({"t": "time_msecs"}, {"t": "ms"}) == []
    assert told({"t": "t_us"}, {"t": "s"}) == [("unit", "t_us")]


def test_a_desired_position_is_a_reference():
    for name in ("q_d[0]", "q_set_1", "qd_des_1", "pos_soll_1"):
        assert told({"q_ref": [name]}) == []
    assert told({"q_ref": ["q_1"]}) == [("reads like q", "q_1")]
    assert told({"q_ref": ["tau_J_d[0]"]}) == [("reads like tau", "tau_J_d[0]")]
