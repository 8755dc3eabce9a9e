from .simulation.control_loop import virtual_pd as virtual_pd
from .simulation.controllers import Cascade as Cascade, PythonController as PythonController
from .simulation.direction import Direction as Direction, ParametrisedLoop as ParametrisedLoop
from .simulation.gravity_compensation import (
    GravityCompensated as GravityCompensated,
    GravityModel as GravityModel,
)
from .simulation.joint_loop import (
    JointFeedback as JointFeedback,
    JointLoop as JointLoop,
    joint_feedbacks as joint_feedbacks,
)
from .simulation.simulated_record import SimulatedRecord as SimulatedRecord
from .simulation.tangents import (
    TangentBlock as TangentBlock,
    simulate_with_tangents as simulate_with_tangents,
    tangent_blocks as tangent_blocks,
)
