"""Why the model of an identification cannot be simulated, as notes of the error that says so."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pivident.estimation.identify import identify as bare_identify
from pivident.foundation.errors import SimulationFailed
from pivident.judgement.audit.recording_audit import recording_faults
from pivident.judgement.validation.given_warnings import warned


def explain(error: SimulationFailed) -> None:
    """Note the cause and what an audit has against the log, before the notes that are there.

    An error from outside of identifications, or one that is explained already, stays as it is.
    """
    problem, error.problem = error.problem, None
    if problem is None:
        return
    from pivident.judgement.validation.divergence_cause import divergence_cause

    causes = divergence_cause(problem, error) if error.from_start else []
    faults = recording_faults(problem.robot, problem.recordings)
    notes = [*causes, *(fault.advised for fault in faults if fault.severity == "error")]
    notes += getattr(error, "__notes__", [])
    error.__notes__ = []
    for note in notes:
        error.add_note(note)


@contextmanager
def explained_failures() -> Iterator[None]:
    """Simulations that fail inside raise errors that name the cause."""
    try:
        yield
    except SimulationFailed as error:
        explain(error)
        raise


#: `pivident.estimation.identify.identify`, whose errors name the cause of a failed simulation; for
#: studies, which show themselves what each of their results finds.
explained_identify = explained_failures()(bare_identify)
#: The same for users, whom it warns.
identify = warned(explained_identify)
