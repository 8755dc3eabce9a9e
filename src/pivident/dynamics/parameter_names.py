"""What the names of parameters stand for, in words."""

from __future__ import annotations

from collections.abc import Mapping

from pivident.dynamics.parameters import Parameter
from pivident.robot.friction import FrictionColumn

#: Stems of inertial and coupling parameters, those that share their words side by side.
_STEMS = {
    ("xx", "yy", "zz"): "moments of inertia of a link about the axes of its frame",
    ("xy", "xz", "yz"): "products of inertia",
    ("mx", "my", "mz"): "mass times the coordinates of its centre",
    ("m",): "mass",
    ("ia",): "rotor inertia on the joint side",
    ("iam",): "rotor inertia of a coupling",
    ("fvm", "fcm"): "viscous and dry friction of a coupling",
}

#: Friction by its function, whatever the stem.
_FRICTION = {
    FrictionColumn.VISCOUS: "viscous friction",
    FrictionColumn.COULOMB: "Coulomb friction",
    FrictionColumn.OFFSET: "constant torque",
}


def names_in_words(parameters: Mapping[str, Parameter]) -> str:
    """What the names of some parameters stand for, in a line without a full stop.

    Args:
        parameters: by their names as shown; in these an ``r`` marks the head of a group.
    """
    stems = {p.stem for p in parameters.values()}
    words = []
    for together, meaning in _STEMS.items():
        if present := [stem for stem in together if stem in stems]:
            words.append(f"{', '.join(present)}: {meaning}")
    friction = {p.stem: p.friction for p in parameters.values() if p.friction is not None}
    words += [
        f"{stem}: {_FRICTION[term.column]}"
        for stem, term in friction.items()
        if term.column in _FRICTION
    ]
    if others := [s for s, term in friction.items() if term.column not in _FRICTION]:
        words.append(f"{', '.join(others)}: further terms of the friction law")
    if any(name != p.name for name, p in parameters.items()):
        words.append("with r: together with others that no motion of this robot tells from it")
    if any(name[-1:].isdigit() for name in parameters):
        words.append("the number is that of the link or joint, counted from the base")
    return "; ".join(words)
