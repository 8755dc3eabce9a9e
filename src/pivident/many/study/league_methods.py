"""Which methods a league compares."""

from __future__ import annotations

from collections.abc import Sequence

from pivident.errors import ExperimentError
from pivident.estimation.methods import METHODS
from pivident.robot.naming import nearest

#: Stands for all methods of a league.
ALL = "all"

#: What ``all`` leaves out: another name of ``ls``, and simulations without feedback, in which an
#: arm that is held up by its control law falls.
LEFT_OUT = ("wls", "oloe")


def league_methods(names: Sequence[str]) -> list[str]:
    """Methods by name, ``all`` written out, those named ``-NAME`` taken out; in order, each once.

    Raises:
        ExperimentError: there is no such method, or none is left.
    """
    chosen: dict[str, None] = {}
    taken_out = set()
    for name in names:
        bare = name.removeprefix("-")
        if bare not in (ALL, *METHODS):
            raise ExperimentError(f"there is no method {bare!r}; {nearest(bare, (ALL, *METHODS))}")
        if name.startswith("-"):
            taken_out.add(bare)
        elif name == ALL:
            chosen |= dict.fromkeys(m for m in METHODS if m not in LEFT_OUT)
        else:
            chosen[name] = None
    left = [name for name in chosen if name not in taken_out]
    if not left:
        raise ExperimentError("no method is left; name some, such as all,-particle or ls,iv,piv")
    return left
