from .fit_simulator import fit_simulator as fit_simulator
from .held_out import HeldOut as HeldOut
from .held_out import held_out_errors as held_out_errors
from .robot_files import fitted_file as fitted_file
from .simulator_fit import FittedValue as FittedValue
from .simulator_fit import SimulatorFit as SimulatorFit
