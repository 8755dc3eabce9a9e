"""From log and robot to a first experiment file, every assumption in it with its reason."""

from pivident.init.assumption import Assumption as Assumption
from pivident.init.draft import Draft as Draft
from pivident.init.draft import draft_experiment as draft_experiment
