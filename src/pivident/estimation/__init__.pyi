from .auxiliary_model import AuxiliaryModel as AuxiliaryModel
from .control_law.identified_law import (
    ControllerIdentification as ControllerIdentification,
    identify_controller as identify_controller,
)
from .control_law.unknown_loop import (
    Feedback as Feedback,
    feedback_from_noise as feedback_from_noise,
    reconstruct_loop as reconstruct_loop,
)
from .didim import Didim as Didim
from .drives.drive_gains import (
    DriveGains as DriveGains,
    identify_drive_gains as identify_drive_gains,
)
from .drives.gear_losses import GearLosses as GearLosses, identify_gears as identify_gears
from .drives.known_payload import Payload as Payload
from .drives.log_units import (
    MotorInLogUnits as MotorInLogUnits,
    identify_in_log_units as identify_in_log_units,
)
from .kinematics import estimate_kinematics as estimate_kinematics
from .known_parameters import (
    Equality as Equality,
    KnownParameters as KnownParameters,
    Prior as Prior,
)
from .literature.correlated_joints import CorrelatedJoints as CorrelatedJoints
from .literature.filters.kalman_filters import (
    CentralDifferenceKalman as CentralDifferenceKalman,
    ExtendedKalman as ExtendedKalman,
    UnscentedKalman as UnscentedKalman,
)
from .literature.filters.online import KalmanFilter as KalmanFilter
from .literature.filters.particle_filter import Particles as Particles
from .literature.filters.recursive import (
    RecursiveInstruments as RecursiveInstruments,
    RecursiveLeastSquares as RecursiveLeastSquares,
)
from .literature.frequency_domain import FrequencyDomain as FrequencyDomain
from .literature.neural_networks import Adaline as Adaline, Hopfield as Hopfield
from .literature.penalised_regression import PriorRegression as PriorRegression, Ridge as Ridge
from .literature.robust_regression import RobustRegression as RobustRegression
from .literature.rows import (
    NormalEquations as NormalEquations,
    Noticed as Noticed,
    Regression as Regression,
    Rows as Rows,
    Solved as Solved,
    windows_covariance as windows_covariance,
)
from .literature.set_membership import SetMembership as SetMembership
from .literature.total_least_squares import TotalLeastSquares as TotalLeastSquares
from .method import (
    Arma as Arma,
    AutoRegressive as AutoRegressive,
    Cost as Cost,
    Handles as Handles,
    Method as Method,
)
from .output_error.output_error import OutputError as OutputError
from .own_estimate import OwnMethod as OwnMethod
from .signal_recipes import Algebraic as Algebraic
