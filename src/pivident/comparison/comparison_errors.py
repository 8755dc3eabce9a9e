"""What goes wrong in a comparison."""

from __future__ import annotations

from pivident.errors import PividentError


class ComparisonError(PividentError, ValueError):
    """Results that cannot be compared: fewer than two, none in a folder, names that do not fit."""
