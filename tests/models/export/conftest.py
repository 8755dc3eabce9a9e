"""The loop in MuJoCo, `benchmarks/mujoco_loop.py`, has its tests here."""

import sys

from tests.conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "benchmarks"))
