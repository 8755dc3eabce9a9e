"""Records with one planted fault each, from a simulator that is not pivident's, and their truth."""

from .cases import Case, make_case
from .faults import FAULTS

__all__ = ["FAULTS", "Case", "make_case"]
