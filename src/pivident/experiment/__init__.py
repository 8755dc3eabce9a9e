"""The experiment file: what was logged, on which machine, and what is to be estimated."""

from pivident.experiment.experiment import Experiment as Experiment
from pivident.experiment.experiment import load_experiment as load_experiment
