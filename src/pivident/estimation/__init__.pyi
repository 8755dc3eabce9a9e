from .auxiliary_model import AuxiliaryModel as AuxiliaryModel
from .identify import build_regression as build_regression
from .kinematics import estimate_kinematics as estimate_kinematics
from .methods import Algebraic as Algebraic
from .methods import FrequencyDomain as FrequencyDomain
from .methods import OutputError as OutputError
from .noise_options import Arma as Arma
from .noise_options import AutoRegressive as AutoRegressive
