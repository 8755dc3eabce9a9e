"""From log and robot to a first experiment file, every guess in it with its reason."""

from pivident.init.draft import Draft as Draft
from pivident.init.draft import draft_experiment as draft_experiment
from pivident.init.guess import Guess as Guess
