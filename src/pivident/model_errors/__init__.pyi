from .corrections import Corrections as Corrections
from .corrections import corrections as corrections
from .corrections import with_corrections as with_corrections
from .named_causes import ModelErrors as ModelErrors
from .named_causes import NamedCause as NamedCause
from .named_causes import named_causes as named_causes
from .unchecked_causes import UncheckedCause as UncheckedCause
