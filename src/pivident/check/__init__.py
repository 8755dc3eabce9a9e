"""What is wrong with an experiment, before anything heavy is computed from it."""

from pivident.check.experiment_check import ExperimentCheck, check_experiment
from pivident.check.remark import Remark

__all__ = ["ExperimentCheck", "Remark", "check_experiment"]
