from .assumption import Assumption as Assumption
from .assumption import Question as Question
from .draft import Draft as Draft
from .draft import draft_experiment as draft_experiment
