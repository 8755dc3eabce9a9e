"""A study that takes a second: the planar arm, short records, few methods."""

from pivident.studies.many.study.scenario import Scenario, read_scenario

TEXT = """
description = "planar arm, for tests"
runs = 6
seed = 7
robot = "planar_2r"

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]

[record]
rate = 500

[trajectory]
duration = 2.0
seed = 2
reach = 1.5

[noise]
encoder = 2e-6
torque = 0.05

[identify]
methods = ["ls", "iv-full-rate"]
"""


def small(**tables) -> Scenario:
    """The scenario, with tables merged in."""
    scenario = read_scenario(TEXT, "small")
    return scenario.changed(**tables) if tables else scenario
