"""The example's robust estimator is nearer to the truth than least squares, and is said to be."""

import numpy as np

from tests.planar_log import planar_truth
from tests.test_example_known_parameters import example


def test_own_estimator(tmp_path):
    results, verdict = example("own_estimator").main(tmp_path)
    truth = planar_truth()
    off = {
        name: np.abs([found.value(n) - truth[n] for n in ("zz1r", "mx1r", "fc1", "fc2")]).max()
        for name, found in results.items()
    }
    assert off["own"] < 0.5 * off["ls"]
    assert "bisquare" in verdict
    assert "bisquare" in (tmp_path / "report.html").read_text("utf-8")
