"""The inputs of the fuzzer, `benchmarks/fuzzing`, serve its short tests too."""

import sys

from tests.conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "benchmarks"))
