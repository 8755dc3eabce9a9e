"""Whether a log's rate suits its motion, whatever the noise of its positions."""

import numpy as np
import pytest

from pivident.experiment.check.motion_check import _slow_rate

T = np.arange(20_000) / 1000.0
MOTION = np.stack(
    [np.sin(1.9 * T), 0.5 * np.sin(4.4 * T) + 0.2 * np.sin(12.6 * T)],
    axis=1,
)
NOISE = 1e-3 * np.random.default_rng(0).standard_normal(MOTION.shape)


@pytest.mark.parametrize(
    "positions", [np.round(MOTION, 3), MOTION + NOISE], ids=["counts", "noise"]
)
def test_noise_of_the_positions_is_no_motion(positions):
    assert not list(_slow_rate(positions, 1000.0))
    (remark,) = _slow_rate(positions[::40], 25.0)
    assert "rate of 25 Hz is low for this motion: 99 % of its speed lies below 2." in remark.message
    assert "log at 4" in remark.next_step
