import csv
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pivident.estimation import identification_file as export
from pivident.estimation.identification_file import save_identification, to_csv, to_dict, to_json
from pivident.foundation.errors import PividentError
from tests.synthetic_identification import synthetic_identification, synthetic_loop

KEYS = (
    "schema method kind robot converged iterations parameters covariance robust_covariance "
    "formula_covariance relative_error joints history condition controller reference "
    "instruments options warnings sources version readings motion robot_description torque_sums "
    "equation_noise simulation"
).split()


def strict(text: str):
    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def test_keys_and_values():
    identification = synthetic_identification()
    content = to_dict(identification)
    assert list(content) == KEYS
    assert content["schema"] == 4
    assert content["robot"] == identification.robot.name
    assert list(content["parameters"][0]) == list(export.CSV_COLUMNS)
    assert content["joints"][0]["masked"] == identification.joints[0].masked
    assert content["history"][-1]["ar_orders"] == [20, 20]
    assert content["options"]["signals"]["f50_max"] is None


def test_json_is_strict_and_exact():
    identification = synthetic_identification()
    loose = replace(
        identification,
        condition=np.inf,
        judged=None,
        theta=np.r_[0.0, identification.theta[1:]],
        joints=tuple(replace(j, f50=np.nan) for j in identification.joints),
        options={"path": Path("log.csv"), "gain": np.float32(np.nan), "size": np.int64(3)},
    )
    content = strict(to_json(loose))
    assert content["condition"] is None
    assert content["parameters"][0]["relative_std"] is None
    assert content["joints"][0]["f50"] is None
    assert content["options"] == {"path": "log.csv", "gain": None, "size": 3}
    np.testing.assert_array_equal([p["value"] for p in content["parameters"]], loose.theta)
    np.testing.assert_array_equal(content["covariance"], loose.covariance)


def test_loop_that_was_not_found_is_null():
    content = to_dict(synthetic_identification())
    assert content["controller"] is None
    assert content["reference"] is None


def test_identified_law_is_there_as_plain_values():
    content = strict(to_json(synthetic_identification(loop=synthetic_loop("law"))))
    first, second = content["controller"]
    assert first["joint"] == "shoulder"
    assert first["terms"] == ["kp", "kd", "ki"]
    assert first["gains"] == [5000.0, 120.0, 30.0]
    assert first["std"] == [2.0, 0.1, 0.5]
    assert first["differentiator"] == {"kind": "lag", "time": 2e-3, "std": 1e-5}
    assert first["relative_error"] == 0.004
    assert first["saturated"] == 12
    assert first["f_tests"] == {"ki": 900.0, "offset": 1.5}
    assert second["differentiator"]["kind"] == "two_sample_means"
    assert content["reference"] is None


def test_reference_and_feedback_are_there_as_plain_values():
    content = strict(to_json(synthetic_identification(loop=synthetic_loop("moves"))))
    assert content["reference"] == [
        {
            "kind": "point_to_point",
            "moves": 2,
            "rms": [1e-4, 2e-4],
            "relative": [5e-5, 1e-4],
            "freedom": 0.006,
        }
    ]
    law = content["controller"][0]
    assert (law["gains"], law["std"]) == ([5000.0, 120.0], [2.0, 0.1])
    assert law["relative_error"] is None
    spline = to_dict(synthetic_identification(loop=synthetic_loop("spline")))
    assert spline["reference"][0]["moves"] is None
    assert spline["controller"] is None


def test_csv_has_one_row_per_parameter():
    identification = synthetic_identification()
    rows = list(csv.DictReader(to_csv(identification).splitlines()))
    assert [r["name"] for r in rows] == list(identification.names)
    assert [float(r["value"]) for r in rows] == identification.theta.tolist()


def test_csv_survives_names_with_commas_and_quotes():
    identification = synthetic_identification()
    names = ('zz["a,b"]', *identification.names[1:])
    (first, *_) = csv.DictReader(to_csv(replace(identification, names=names)).splitlines())
    assert first["name"] == 'zz["a,b"]'


def test_saved_files_can_be_read(tmp_path):
    synthetic_identification().save(tmp_path / "out")
    assert sorted(os.listdir(tmp_path / "out")) == ["identification.json", "parameters.csv"]
    assert strict((tmp_path / "out" / "identification.json").read_text("utf-8"))["schema"] == 4


def test_bytes_in_file_names_do_not_break_the_files(tmp_path):
    sources = {os.fsdecode(b"caf\xe9.csv"): "00"}
    save_identification(synthetic_identification(sources=sources), tmp_path)
    assert strict((tmp_path / "identification.json").read_text("utf-8"))["sources"] == sources


@pytest.mark.parametrize("stop", [KeyboardInterrupt, RuntimeError])
def test_interrupted_writing_keeps_the_old_files(tmp_path, monkeypatch, stop):
    save_identification(synthetic_identification(), tmp_path)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}

    def interrupted(identification):
        raise stop

    monkeypatch.setattr(export, "to_csv", interrupted)
    with pytest.raises(stop):
        save_identification(synthetic_identification("IDIM-LS"), tmp_path)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_full_disk_keeps_the_old_files(tmp_path, monkeypatch):
    save_identification(synthetic_identification(), tmp_path)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    write_text = Path.write_text

    def full(self, text, **options):
        write_text(self, text[:50], **options)
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(PividentError, match="No space left"):
        save_identification(synthetic_identification("IDIM-LS"), tmp_path)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before
