from .consistency.consistent_model import ConsistentModel as ConsistentModel
from .consistency.constraints import Bounds as Bounds
from .export.c_source import to_c as to_c, verify_c as verify_c
from .export.formats import export_model as export_model, verify_export as verify_export
from .export.urdf import to_urdf as to_urdf
from .model_json import read_model as read_model, to_json as to_json
from .runnable_model import (
    RunnableModel as RunnableModel,
    runnable_model as runnable_model,
    standard_from_base as standard_from_base,
)
from .stored_model import stored_model as stored_model
from .symbolic.assignments import Input as Input, Output as Output
from .symbolic.newton_euler import (
    inverse_model as inverse_model,
    observation_matrix as observation_matrix,
)
from .symbolic.program import Program as Program
from .symbolic.robot_models import (
    closure_equations as closure_equations,
    joint_motion as joint_motion,
    symbolic_models as symbolic_models,
)
