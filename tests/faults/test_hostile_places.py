"""Files of other places, devices, and bombs: nothing is waited for or unpacked whole."""

import gzip
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from pivident.data.logs.tables.tables import names_in, read_table
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import PividentError, RobotDescriptionError
from pivident.robot.gallery import load_robot
from pivident.robot.modified_dh import read_modified_dh
from pivident.robot.urdf import read_urdf
from pivident.studies.many.study.scenario import load_scenario
from tests.faults.hostile import archive, npy, written

READERS = {
    "csv": read_table,
    "npz": read_table,
    "mat": read_table,
    "parquet": read_table,
    "urdf": read_urdf,
    "robot.toml": read_modified_dh,
    "experiment.toml": load_experiment,
    "study.toml": load_scenario,
}

EVERY = pytest.mark.parametrize("ending", READERS)


@EVERY
def test_a_pipe_is_not_waited_for(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    os.mkfifo(path)
    with pytest.raises(PividentError, match="a device or a pipe"):
        READERS[ending](path)


@EVERY
def test_a_device_is_not_read_for_ever(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    path.symlink_to("/dev/zero")
    with pytest.raises(PividentError, match="a device or a pipe"):
        READERS[ending](path)


@EVERY
def test_a_name_with_nul_is_refused(ending):
    with pytest.raises(PividentError, match="NUL"):
        READERS[ending](f"a\0b.{ending}")


@EVERY
def test_a_name_without_end_is_refused(ending):
    with pytest.raises(PividentError):
        READERS[ending](f"{'a' * 5000}.{ending}")


def test_a_robot_named_with_nul_in_an_experiment_is_refused(tmp_path):
    path = written(tmp_path, "e.toml", '[robot]\nmodel = "a\\u0000.urdf"\n[recording]\n'
                   'files = "x"\ncolumns = {q = "q", tau = "tau"}\n')  # fmt: skip
    with pytest.raises(RobotDescriptionError, match="NUL"):
        _ = load_experiment(path).robot


def test_bombs_stay_within_half_a_gigabyte(tmp_path):
    """In a process that may not have more, each bomb is refused by name."""
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (2000000000,), }\n"
    archive(tmp_path, x=npy(header, bytes(2**20)))
    written(tmp_path, "a.urdf.gz", gzip.compress(b"<robot>" + bytes(10**8), 1))
    written(tmp_path, "a.toml", b"a" * 2**21)
    code = f"""
import os, resource, sys
from pivident.foundation.errors import PividentError
from pivident.data.logs.tables.tables import read_table
from pivident.robot.gallery import load_robot
import numpy
pages = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (pages + 2**28, -1))
for read, name in ((read_table, "a.npz"), (load_robot, "a.urdf.gz"), (load_robot, "a.toml")):
    try:
        read(os.path.join({str(tmp_path)!r}, name))
    except PividentError as error:
        print(name)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split() == ["a.npz", "a.urdf.gz", "a.toml"], done.stderr


def test_gallery_names_are_no_paths():
    for name in ("../../../etc/passwd", "/etc/passwd", "staubli_tx40\0", "..", "a b; rm -rf ."):
        with pytest.raises(RobotDescriptionError):
            load_robot(name)


def test_what_is_read_comes_back_whole(tmp_path):
    """The bounds above do not touch an honest file."""
    path = tmp_path / "a.npz"
    np.savez_compressed(path, q=np.zeros((1_000_00, 6)))
    assert read_table(path)["q"].shape == (100_000, 6)
    assert json.dumps(names_in(path)) == '["q"]'
