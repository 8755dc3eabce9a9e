"""Keys of a TOML text are found on their lines."""

import pytest

from pivident.experiment.check.experiment_check import TomlLines

TEXT = """\
robot = "arm"
a.b = 1

[[recording]]
files = "x.csv"   # "not [a] table"
columns = {t = "t"}   # line 6

[[recording]]
files = "y = [1"
[recording.units]
q = "deg"
[identify]
methods = [
  "ls",   # kp = 3
  "piv",
]
mask = 0.1
"iv-full-rate" = {tolerance = 0.1}
"""


@pytest.mark.parametrize(
    ("place", "line"),
    [
        (("robot",), 1),
        (("robot", "model"), 1),
        (("a", "b"), 2),
        (("recording", 0), 4),
        (("recording", 0, "files"), 5),
        (("recording", 0, "columns", "t"), 6),
        (("recording", 1, "files"), 9),
        (("recording", 1, "units", "q"), 11),
        (("recording", 1, "rate"), 8),
        (("identify", "mask"), 17),
        (("identify", "iv-full-rate", "tolerance"), 18),
        (("controller", "kp"), None),
        ((), None),
    ],
)
def test_line_of_a_place(place, line):
    assert TomlLines(TEXT).line(place) == line
