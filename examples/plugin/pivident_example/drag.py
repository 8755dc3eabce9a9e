"""Drag of a fluid, cd dq |dq|: a friction term, with its functions in ``drag_compiled``."""

from pivident.robot.friction_column import FrictionColumn
from pivident.robot.friction_term import Candidate, FrictionTerm, TermKind

DRAG = FrictionColumn(
    name="drag",
    expression="dq*abs(dq)",
    text="{stem} dq |dq|",
    compiled="pivident_example.drag_compiled:drag",
    speed_power=2.0,
    dissipative=True,
)


def drag() -> FrictionTerm:
    """Friction cd dq |dq| [N m (s/rad)²], of arms under water."""
    return FrictionTerm("cd", DRAG)


DRAG_TERM = TermKind(
    "drag",
    drag,
    (DRAG,),
    candidates=(Candidate("drag", lambda *_: (drag(),), unless=("drag",)),),
    causes={"drag": "dq*abs(dq)/fastest**2"},
)
