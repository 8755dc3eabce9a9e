from .design import Design as Design
from .motions import ExcitingMotion as ExcitingMotion
from .motions import MotionFamily as MotionFamily
