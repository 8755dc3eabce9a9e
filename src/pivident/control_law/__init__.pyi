from .identified_law import ControllerIdentification as ControllerIdentification
from .identified_law import identify_controller as identify_controller
from .unknown_loop import Feedback as Feedback
from .unknown_loop import feedback_from_noise as feedback_from_noise
from .unknown_loop import reconstruct_loop as reconstruct_loop
