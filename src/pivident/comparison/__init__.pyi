from .compare import ComparedParameter as ComparedParameter
from .compare import Comparison as Comparison
from .compared_results import Difference as Difference
