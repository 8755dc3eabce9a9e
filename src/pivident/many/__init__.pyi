from .fleet.identify_fleet import Fleet as Fleet
from .fleet.identify_fleet import identify_fleet as identify_fleet
from .fleet.judgement import Judgement as Judgement
from .study.bench import Bench as Bench
from .study.monte_carlo import run_study as run_study
from .study.scenario import Scenario as Scenario
from .study.scenario import load_scenario as load_scenario
from .study.scenario import read_scenario as read_scenario
