"""What a page's reader has before the page begins: a log, an experiment file, results.

Each function fills the current folder; a page calls it by a ``before`` mark.
"""

from pathlib import Path

from tests.planar_log import EXPERIMENT, write_log
from tests.synthetic_identification import synthetic_identification


def planar_log() -> None:
    """`log.csv` of the planar arm, and `my_robot.toml` that describes it."""
    write_log(Path("log.csv"))
    Path("my_robot.toml").write_text(EXPERIMENT, encoding="utf-8")


def synthetic_results() -> None:
    """`my_robot-results` and `results`: an estimate of the planar arm, without a record."""
    for name in ("my_robot-results", "results"):
        if not Path(name).exists():
            synthetic_identification(relative_std=0.02).save(name)
