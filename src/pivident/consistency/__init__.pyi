from .consistent_model import ConsistentModel as ConsistentModel
from .constraints import Bounds as Bounds
from .standard_from_base import standard_from_base as standard_from_base
