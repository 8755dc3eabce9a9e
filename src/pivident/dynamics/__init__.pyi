from .base_parameters import BaseParameters as BaseParameters
from .parameters import Parameter as Parameter
from .regressor import Regressor as Regressor
