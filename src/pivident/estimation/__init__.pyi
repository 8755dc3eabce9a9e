from .auxiliary_model import AuxiliaryModel as AuxiliaryModel
from .didim import Didim as Didim
from .identify import build_regression as build_regression
from .kinematics import estimate_kinematics as estimate_kinematics
from .literature.adaline import Adaline as Adaline
from .literature.correlated_joints import CorrelatedJoints as CorrelatedJoints
from .literature.filters.central_difference_kalman import (
    CentralDifferenceKalman as CentralDifferenceKalman,
)
from .literature.filters.extended_kalman import ExtendedKalman as ExtendedKalman
from .literature.filters.online import KalmanFilter as KalmanFilter
from .literature.filters.particle_filter import Particles as Particles
from .literature.filters.recursive import RecursiveInstruments as RecursiveInstruments
from .literature.filters.recursive import RecursiveLeastSquares as RecursiveLeastSquares
from .literature.filters.unscented_kalman import UnscentedKalman as UnscentedKalman
from .literature.frequency_domain import FrequencyDomain as FrequencyDomain
from .literature.hopfield import Hopfield as Hopfield
from .literature.prior_regression import PriorRegression as PriorRegression
from .literature.ridge import Ridge as Ridge
from .literature.robust_regression import RobustRegression as RobustRegression
from .literature.rows import NormalEquations as NormalEquations
from .literature.rows import Noticed as Noticed
from .literature.rows import Regression as Regression
from .literature.rows import Rows as Rows
from .literature.rows import Solved as Solved
from .literature.rows import windows_covariance as windows_covariance
from .literature.set_membership import SetMembership as SetMembership
from .literature.total_least_squares import TotalLeastSquares as TotalLeastSquares
from .method import Arma as Arma
from .method import AutoRegressive as AutoRegressive
from .method import Cost as Cost
from .method import Handles as Handles
from .method import Method as Method
from .output_error.output_error import OutputError as OutputError
from .signal_recipes import Algebraic as Algebraic
