from .check.audit_file import audit_file as audit_file
from .check.experiment_check import (
    ExperimentCheck as ExperimentCheck,
    check_experiment as check_experiment,
)
from .check.plan import Plan as Plan
from .check.remark import Remark as Remark
from .experiment import Experiment as Experiment
from .init.assumption import Assumption as Assumption, Question as Question
from .init.draft import Draft as Draft, draft_experiment as draft_experiment
