from .diagnostics import Diagnostics as Diagnostics
from .statement import Statement as Statement
from .verdict import Verdict as Verdict
