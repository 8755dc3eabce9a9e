from .chosen_laws import LawChoice as LawChoice
from .law_candidates import adding as adding
from .law_choice import choose_laws as choose_laws
from .shapes import ShapedIdentification as ShapedIdentification
from .shapes import identify_shapes as identify_shapes
