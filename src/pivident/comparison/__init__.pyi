from .compare import ComparedParameter as ComparedParameter
from .compare import Comparison as Comparison
from .differences import Difference as Difference
