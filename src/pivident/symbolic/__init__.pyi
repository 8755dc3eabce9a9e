from .assignments import Input as Input
from .assignments import Output as Output
from .newton_euler import inverse_model as inverse_model
from .newton_euler import observation_matrix as observation_matrix
from .program import Program as Program
from .robot_models import closure_equations as closure_equations
from .robot_models import joint_motion as joint_motion
from .robot_models import symbolic_models as symbolic_models
