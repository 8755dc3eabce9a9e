from .essential_parameters import EssentialParameters as EssentialParameters
from .essential_parameters import essential_parameters as essential_parameters
from .held_out.cross_validation import CrossValidation as CrossValidation
from .held_out.replay import as_logged as as_logged
from .identified_loop import IdentifiedJointLoop as IdentifiedJointLoop
from .identified_loop import IdentifiedLoop as IdentifiedLoop
from .identified_loop import identified_loop as identified_loop
