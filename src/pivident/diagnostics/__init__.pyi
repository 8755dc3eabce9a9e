from .diagnostics import Diagnostics as Diagnostics
from .verdict import Verdict as Verdict
