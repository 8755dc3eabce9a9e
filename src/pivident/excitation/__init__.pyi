from .bodies import Body as Body
from .bodies import Outline as Outline
from .bodies import bodies_of_entries as bodies_of_entries
from .bodies import outline_of as outline_of
from .clearances import Clearances as Clearances
from .clearances import clearances_of_room as clearances_of_room
from .design import ClearanceUse as ClearanceUse
from .design import Design as Design
<<<<<<< HEAD
from .design import LimitUse as LimitUse
from .design import PredictedError as PredictedError
from .design_motion import design_motion as design_motion
from .limits import JointLimits as JointLimits
from .limits import joint_limits as joint_limits
=======
from .design_file import DesignFileError as DesignFileError
from .design_file import load_design as load_design
from .design_files import write_design as write_design
>>>>>>> pages
from .motions import ExcitingMotion as ExcitingMotion
from .motions import MotionFamily as MotionFamily
from .obstacles import Obstacle as Obstacle
from .obstacles import ToolBox as ToolBox
from .obstacles import obstacles_of_entries as obstacles_of_entries
from .request import DesignRequest as DesignRequest
