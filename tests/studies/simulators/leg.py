"""The example's leg: a log that MuJoCo has simulated, and the truth behind it."""

import importlib.util
from pathlib import Path

SCRIPT = Path(__file__).parents[3] / "examples" / "suspended_leg" / "simulate_log.py"


def example():
    """The example's script as a module."""
    spec = importlib.util.spec_from_file_location(SCRIPT.stem, SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def write_leg(folder: Path):
    """Write `log.csv`, `leg.xml` and `leg.toml`; the module with the truth."""
    module = example()
    module.main(folder)
    return module
