"""Errors of the results folder of a study."""

from __future__ import annotations

from pivident.many.batch.batch_errors import OtherContents, ResultsFolderError


class StudyFolderError(ResultsFolderError):
    """A results folder of a study that cannot be used or written to."""


class OtherScenario(OtherContents, StudyFolderError):
    """A results folder that holds the runs of another scenario."""

    rows, owner = "runs", "scenario"
