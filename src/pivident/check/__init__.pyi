from .experiment_check import ExperimentCheck as ExperimentCheck
from .experiment_check import check_experiment as check_experiment
from .plan import Plan as Plan
from .remark import Remark as Remark
