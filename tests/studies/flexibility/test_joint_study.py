"""What `pivident flexibility` asks of a recording before it begins."""

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import RecordingError
from pivident.robot.gallery import load_robot
from pivident.studies.flexibility.joint_study import study_flexibility


def test_stiffness_needs_a_measured_torque():
    robot = load_robot("planar_2r")
    q = np.sin(np.arange(400) / 50.0)[:, None] * np.ones(2)
    bare = Recording.from_arrays(q, None, 1000.0, joint_names=robot.joint_names, q_ref=q + 0.01)
    with pytest.raises(RecordingError, match=r"no measured torque.*map the column of tau"):
        study_flexibility(robot, [bare])
