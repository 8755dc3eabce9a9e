"""An identification from its file: everything but the signals.

What `identification_file` writes is read back, and checked as if a stranger had written it:
types, shapes, finite numbers, symmetric covariances, and parameters that are base parameters of
the robot in the file. The result predicts torques, prints, is made consistent and exported like
the one that `identify` returned. Its recordings, equations and loop are not there, and tests that
need them say so.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters, regrouped_name
from pivident.estimation.identification import Identification
from pivident.estimation.identification_file import (
    IDENTIFICATION,
    IdentificationTable,
    method_of_options,
)
from pivident.foundation.codec import decode
from pivident.foundation.errors import IdentificationFileError, UnusableValue, require_known
from pivident.loop.instruments.kinds import KINDS
from pivident.robot.description import Robot
from pivident.robot.naming import nearest
from pivident.robot.robot_values import StoredRobot

#: Largest asymmetry of a covariance, relative to its standard errors, and most negative eigenvalue
#: of its correlations that the rounding of versions explains which wrote what they had computed:
#: up to κ²ε at the largest condition number that is solved, 1e6.
ASYMMETRY = INDEFINITE = 1e-3

#: The first layout, which did not hold the robot.
WITHOUT_ROBOT = 1


@dataclass(frozen=True, eq=False)
class _RobotOfFile:
    """The robot in a file, which says how many joints the rest is about."""

    passes_over_others: ClassVar[bool] = True
    robot_description: StoredRobot


def load_identification(path: str | PathLike[str], robot: Robot | None = None) -> Identification:
    """Read ``identification.json``.

    Args:
        path: the file, or the folder that holds it.
        robot: the robot, for files of the first layout, which do not hold it.

    Returns:
        The identification without recordings, equations and loop.

    Raises:
        IdentificationFileError: the file cannot be read, is damaged, of another layout, or does
            not fit its robot; names file, key, value and next step.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> result = pv.identify(pv.Problem(robot, (recording,), loop), "piv")
        >>> result.save("my-arm")
        >>> pv.load_identification("my-arm").params == result.params
        True
    """
    file = Path(path)
    if file.is_dir():
        file = file / "identification.json"
    content = _content(file, robot)
    with IDENTIFICATION.damage(str(file)):
        own = robot or decode(_RobotOfFile, content).robot_description
        rest = {key: x for key, x in content.items() if key != "robot_description"}
        return _identification(decode(IdentificationTable, rest, joints=own.size), own)


def json_of_file(file: Path) -> dict[str, Any]:
    """A JSON object as plain values."""
    found = [] if file.is_file() else sorted(file.parent.glob("*/identification.json"))
    if not found:
        return IDENTIFICATION.json(file)
    names = ", ".join(repr(each.parent.name) for each in found)
    return IDENTIFICATION.json(file, f"there is one for each method: {names}; name one")


def _content(file: Path, robot: Robot | None) -> dict[str, Any]:
    """The content of a file whose layout this version knows, with a robot if none is given."""
    content = json_of_file(file)
    schema = content.get("schema")
    if type(schema) is not int or "covariance" not in content:
        raise IdentificationFileError(
            str(file),
            "is not an identification: it has no schema number or covariance",
            advice=IDENTIFICATION.give,
        )
    if schema <= WITHOUT_ROBOT and robot is None:
        raise IdentificationFileError(
            str(file),
            f"has layout {schema}, written by an older version, which did not keep the robot",
            advice="identify again, or give the robot: load_identification(path, robot=…)",
        )
    if WITHOUT_ROBOT < schema <= IDENTIFICATION.version:
        if robot is not None:
            raise IdentificationFileError(
                str(file), "holds its robot already", advice="leave the argument robot out"
            )
        if not isinstance(content.get("robot_description"), dict):
            raise IdentificationFileError(
                str(file), "the key 'robot_description' is missing", advice="identify again"
            )
    return IDENTIFICATION.raised(content, str(file))


def _identification(table: IdentificationTable, robot: Robot) -> Identification:
    """The identification of its table; refuses what does not belong together."""
    if [fit.name for fit in table.joints] != list(robot.joint_names):
        raise UnusableValue(
            f"joints are {', '.join(fit.name for fit in table.joints)}, but those of the robot "
            f"are {', '.join(robot.joint_names)}",
            advice="identify again",
        )
    if not isinstance(table.options.get("signals", {}), dict):
        raise UnusableValue(
            "options.signals must be a dictionary of options", advice="identify again"
        )
    if table.instruments is not None and table.instruments.kind not in KINDS:
        raise UnusableValue(
            f"instruments.kind = {table.instruments.kind!r}",
            advice=nearest(table.instruments.kind, KINDS),
        )
    kinds = ("covariance", "robust_covariance", "formula_covariance")
    covariances = {key: _covariance(key, getattr(table, key)) for key in kinds}
    base, chosen = _selection(robot, [p.name for p in table.parameters])
    sums = table.torque_sums
    if sums is not None and len(sums.moment) != len(base):
        raise UnusableValue(
            f"torque_sums: 'gram' has shape {sums.gram.shape}",
            advice=f"{len(base)} base parameters need shape {(len(base), len(base))}",
        )
    own = Identification.__dataclass_fields__.keys() & IdentificationTable.__dataclass_fields__
    made = {
        "robot": robot,
        "parameters": tuple(base.parameters[k] for k in chosen),
        "names": tuple(base.names[k] for k in chosen),
        "expressions": tuple(base.expressions[k] for k in chosen),
        "theta": np.array([p.value for p in table.parameters]),
        "recordings": (),
        "method_used": method_of_options(table.options, table.kind, table.method),
        "loop": None,
        "loop_values": {key: getattr(table, key) for key in ("controller", "reference", "loop")},
    }
    return Identification(**{key: getattr(table, key) for key in own} | covariances | made)


def _selection(robot: Robot, names: list[str]) -> tuple[BaseParameters, list[int]]:
    """The robot's base parameters, and the places of the estimated ones among them, in order.

    They are taken from the closed form, which takes a tenth of the time of the numerical search on
    robots of many joints. Geometry at the edge of a tolerance can make the two differ: where the
    file has other groups that this robot could have, they are searched for.
    """
    from pivident.dynamics.grouping.closed_form import quick_base_parameters

    base = quick_base_parameters(robot)
    heads = {text for p in base.standard for text in (p.name, regrouped_name(p))}
    if not set(base.names).issuperset(names) and heads.issuperset(names):
        base = base_parameters(robot)
    known = {name: k for k, name in enumerate(base.names)}
    for name in names:
        require_known(
            name,
            known,
            f"{name!r} is not a base parameter of the robot {robot.name!r}",
            UnusableValue,
        )
    chosen = [known[name] for name in names]
    if sorted(set(chosen)) != chosen:
        raise UnusableValue(
            f"the parameters {', '.join(names)} are not in the robot's order, each once",
            advice="identify again",
        )
    return base, chosen


def _covariance(key: str, matrix: np.ndarray) -> np.ndarray:
    """A covariance matrix; one that was not finite when it was written is NaN throughout."""
    if not np.isfinite(matrix).all():
        return np.full(matrix.shape, np.nan)
    variance = np.diag(matrix)
    if (variance < 0.0).any():
        worst = int(np.argmin(variance))
        raise UnusableValue(
            f"{key} has the variance {variance[worst]:.3g} in row {worst + 1}",
            advice="a variance cannot be negative, identify again",
        )
    std = np.sqrt(variance)
    if (np.abs(matrix - matrix.T) > ASYMMETRY * np.outer(std, std)).any():
        raise UnusableValue(f"{key} is not symmetric", advice="identify again")
    correlation = matrix / np.where(std > 0.0, std, 1.0) / np.where(std > 0.0, std, 1.0)[:, None]
    if (lowest := float(np.linalg.eigvalsh(correlation)[0])) < -INDEFINITE:
        raise UnusableValue(
            f"{key} is not a covariance: its correlations have the eigenvalue {lowest:.3g}, and "
            "none may be negative",
            advice="identify again",
        )
    return matrix
