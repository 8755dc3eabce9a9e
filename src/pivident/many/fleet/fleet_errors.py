"""Errors of a fleet and of its results folder."""

from __future__ import annotations

from pivident.errors import PividentError
from pivident.many.batch.batch_errors import OtherContents, ResultsFolderError


class FleetError(PividentError):
    """A fleet that cannot be identified or judged."""


class FleetFolderError(ResultsFolderError):
    """A results folder of a fleet that cannot be used or written to."""


class OtherFleet(OtherContents, FleetFolderError):
    """A results folder that holds the results of another fleet."""

    rows, owner = "results", "fleet"
