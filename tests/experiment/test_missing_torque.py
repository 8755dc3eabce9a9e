"""A log without tau: its torque follows from [controller], or what is missing is said."""

import numpy as np
import pytest

from pivident.estimation.methods import WITHOUT_TORQUE
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError
from tests.planar_log import EXPERIMENT, planar_log, write_experiment
from tests.positions_only import POSITIONS_ONLY, WITHOUT_LAW, write_positions


def law(*lines: str) -> str:
    return WITHOUT_LAW + "\n".join(["[controller]", *lines]) + "\n"


def refusal(folder, text: str) -> str:
    experiment = load_experiment(write_positions(folder, text))
    with pytest.raises(ExperimentError) as caught:
        experiment.problem()
    return str(caught.value)


def test_the_law_gives_the_torque_that_the_log_lacks(tmp_path):
    (recording,) = load_experiment(write_positions(tmp_path)).problem().recordings
    assert recording.torque_source == "law"
    logged = planar_log()[:, 5:7]
    # the log has nine digits of the positions: 1e-9 rad times kd and the rate
    np.testing.assert_allclose(recording.tau[1:], logged[1:], atol=2e-3)


def test_methods_are_those_of_logs_without_torque(tmp_path):
    assert tuple(load_experiment(write_positions(tmp_path)).methods()) == WITHOUT_TORQUE


def test_methods_that_compare_torques_are_refused(tmp_path):
    text = POSITIONS_ONLY.replace("[identify]", '[identify]\nmethods = ["didim"]')
    with pytest.raises(ExperimentError, match=r"'didim' needs measured torques.*use ") as caught:
        load_experiment(write_positions(tmp_path, text))
    assert caught.value.table == ("identify",)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (WITHOUT_LAW, "no control law that it would follow from"),
        (law('type = "identify"'), "its law cannot be found without a torque"),
        (
            law('type = "pd"', "kp = 1", "kd = 1", 'reference = "reconstruct"'),
            "its reference cannot be found",
        ),
        (law('type = "virtual_pd"'), "a virtual law commands nothing"),
        (
            POSITIONS_ONLY.replace(', q_ref = ["r1", "r2"]', "").replace(', q_ref = "deg"', ""),
            "no q_ref that the control law would follow",
        ),
        (POSITIONS_ONLY.replace("[recording]", "[recording]\ndelay = 1e-3"), "remove delay"),
    ],
)
def test_what_is_missing_is_said_with_the_next_step(tmp_path, text, said):
    message = refusal(tmp_path, text)
    assert said in message
    assert "tau" in message
    assert str(tmp_path) in message


def test_torques_behind_the_gears_do_not_follow_from_a_law(tmp_path):
    text = WITHOUT_LAW.replace("[recording]", '[recording]\ntorque_side = "link"')
    assert "commands the motors" in refusal(tmp_path, text)


def test_an_unknown_drive_gain_makes_ratios(tmp_path):
    text = POSITIONS_ONLY.replace("kp =", 'drive_gain = "unknown"\nkp =')
    problem = load_experiment(write_positions(tmp_path, text)).problem()
    assert problem.loop is not None
    assert not problem.loop.gain_known
    assert {s.basis for s in problem.recordings[0].torque_scale} == {"output"}


def test_an_unknown_drive_gain_beside_a_torque_is_refused(tmp_path):
    text = EXPERIMENT.replace("kp =", 'drive_gain = "unknown"\nkp =')
    with pytest.raises(ExperimentError, match="for logs without torque"):
        load_experiment(write_experiment(tmp_path, text)).problem()


def test_a_feed_forward_in_newton_metres_needs_the_drive_gain(tmp_path):
    lines = 'drive_gain = "unknown"\nfeed_forward = "gravity"\nkp ='
    assert "give drive_gain" in refusal(tmp_path, POSITIONS_ONLY.replace("kp =", lines))


def test_another_word_is_no_drive_gain(tmp_path):
    text = POSITIONS_ONLY.replace("kp =", 'drive_gain = "none"\nkp =')
    with pytest.raises(ExperimentError, match="drive_gain"):
        load_experiment(write_positions(tmp_path, text))


def test_unseen_recordings_get_the_torque_of_the_law(tmp_path):
    columns = POSITIONS_ONLY[POSITIONS_ONLY.index("files") : POSITIONS_ONLY.index("[controller]")]
    text = f"{POSITIONS_ONLY}\n[[validation.recording]]\n{columns}"
    (unseen,) = load_experiment(write_positions(tmp_path, text)).unseen_recordings()
    assert unseen.torque_source == "law"
    without = text.replace(POSITIONS_ONLY[POSITIONS_ONLY.index("[controller]") :], "")
    with pytest.raises(ExperimentError, match="no control law is known"):
        load_experiment(write_positions(tmp_path, without)).unseen_recordings()
