from .bearing_friction import bearing_friction as bearing_friction
from .friction_study import FrictionStudy as FrictionStudy
from .friction_study import study_friction as study_friction
from .ripple.ripple_lines import NamedOrder as NamedOrder
from .ripple.ripple_lines import remove_ripple as remove_ripple
from .ripple.ripple_search import find_ripple as find_ripple
