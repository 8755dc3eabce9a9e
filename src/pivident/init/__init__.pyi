from .draft import Draft as Draft
from .draft import draft_experiment as draft_experiment
from .guess import Guess as Guess
from .guess import Question as Question
