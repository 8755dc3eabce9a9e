"""What the example says of known parameters is so."""

import importlib.util

import numpy as np

from tests.conftest import REPOSITORY
from tests.planar_log import planar_truth


def example(name):
    path = REPOSITORY / "examples" / "python" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 40
    return module


def test_known_parameters(tmp_path):
    results, compared = example("known_parameters").main(tmp_path)
    truth = planar_truth()
    for name, found in results.items():
        if name != "elbow":  # whose other parameters hold a part of those of the shoulder
            free = found.std > 0.0
            true = np.array([truth[own] for own in found.names])
            off = np.abs(found.theta - true)[free] / found.std[free]
            assert off.max() < 5.0, name
    plain = results["plain"]
    assert results["fixed"].value("ia2") == 0.1
    fixed = results["fixed"]
    assert fixed.std[list(fixed.names).index("ia2")] == 0.0
    assert min(results["bounded"].value(n) for n in ("my1", "my2")) >= 0.0
    assert abs(results["tied"].value("fc1") - 2.0 * results["tied"].value("fc2")) < 1e-9
    assert results["expected"].std[0] < plain.std[0]
    assert (
        abs(results["elbow"].value("fv2") - truth["fv2"])
        < 5 * results["elbow"].std[list(results["elbow"].names).index("fv2")]
    )
    assert "plain" in compared and "fixed" in compared
