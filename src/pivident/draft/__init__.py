"""From log and robot to a first experiment file, every guess in it with its reason."""

from pivident.draft.draft import Draft as Draft
from pivident.draft.draft import draft_experiment as draft_experiment
from pivident.draft.guess import Guess as Guess
