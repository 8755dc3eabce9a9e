from .design import Design as Design
from .design_file import DesignFileError as DesignFileError
from .design_file import load_design as load_design
from .design_files import write_design as write_design
from .motions import ExcitingMotion as ExcitingMotion
from .motions import MotionFamily as MotionFamily
