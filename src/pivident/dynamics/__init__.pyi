from .base_parameters import BaseParameters as BaseParameters
from .inverse_derivatives import (
    InverseDynamicsDerivatives as InverseDynamicsDerivatives,
    inverse_dynamics_derivatives as inverse_dynamics_derivatives,
)
from .own_friction import own_friction as own_friction
from .parameters import Parameter as Parameter
from .regressor import Regressor as Regressor
from .robot_regressor import regressor_of as regressor_of
