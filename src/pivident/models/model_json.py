"""A model as JSON: one file for other programs, from which the model is restored exactly.

    {"format": "pivident-model", "schema": 1, "consistent": …, "origin": {…}, "notes": […],
     "units": {…}, "conventions": […],
     "links": [{"name", "joint", "mass", "center_of_mass", "first_moments", "inertia",
                "inertia_at_origin"} …],
     "parameters": [{"name", "value", "interval", "unit", "joint"} …],
     "base_parameters": [{"name", "group", "value", "estimate", "interval", "unit"} …],
     "robot": {…}}

``robot`` is the robot's description with the model's values as its nominal ones: joints with
frames, limits and friction laws, link inertias, rotor inertias, friction, couplings, transmission.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from pivident.foundation.codec import Layout, decode
from pivident.foundation.errors import UnusableValue
from pivident.foundation.text.plain_values import LATER, Name, Null, json_of_entries, plain
from pivident.models.export_format import Format
from pivident.models.exported import ExportedText, Verification, compared
from pivident.models.runnable_model import Origin, RunnableModel, impossible_value, runnable_model
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.inertia import from_center_of_mass, tensor
from pivident.robot.robot_values import StoredRobot, robot_values

#: Units of the numbers.
UNITS = {
    "length": "m",
    "angle": "rad",
    "mass": "kg",
    "inertia": "kg m²",
    "torque of revolute joints": "N m",
    "force of prismatic joints": "N",
    "gravity": "m/s²",
}

#: Conventions of frames and signs.
CONVENTIONS = (
    "The frame of a link is at its joint, turns or slides with the link, and has the joint's "
    "axis as z.",
    "Pose of a link's frame in its parent's: revolute R = rotation Rz(q), p = translation; "
    "prismatic R = rotation, p = translation + rotation (0, 0, q). Parents count from 0; -1 is "
    "the base.",
    "center_of_mass and inertia are in the link's frame, inertia about the centre of mass (null "
    "and about the origin where a link has no mass), first_moments are mass times centre of mass, "
    "inertia_at_origin about the frame's origin; off-diagonal elements are those of the tensor, "
    "xy = -∫ x y dm.",
    "Torques are on the joint side, as the drives must supply them: inertia, gravity, rotor "
    "inertias and friction.",
    "ia is the rotor inertia referred to the joint; iam fvm fcm belong to couplings.",
    "Intervals are 95 %; an end that is null has no bound, an interval that is null was not "
    "computed.",
)

MODEL = Layout(
    "model",
    1,
    give="make one with `pivident export … --to json`",
    again="export again",
    name="pivident-model",
)


@dataclass(frozen=True)
class StandardValue:
    """A standard parameter, with an interval in the file of a consistent model."""

    passes_over_others: ClassVar[bool] = True
    name: Name
    value: float
    low: Annotated[float, LATER, Null(-math.inf)] = -math.inf
    high: Annotated[float, LATER, Null(math.inf)] = math.inf


@dataclass(frozen=True)
class ModelTable:
    """The part of the file that is read; links and base parameters follow from it."""

    passes_over_others: ClassVar[bool] = True
    consistent: bool
    origin: Origin
    notes: tuple[str, ...]
    parameters: tuple[StandardValue, ...]
    robot: StoredRobot


def to_json(model: RunnableModel) -> ExportedText:
    """The model as JSON, one line for each link and parameter.

    Args:
        model: the model.

    Returns:
        The text as bytes.
    """
    text = json_of_entries(model_values(model))
    return ExportedText(text.encode("utf-8", errors="backslashreplace"))


def model_values(model: RunnableModel) -> dict[str, Any]:
    """The model as plain values."""
    intervals, tree = model.intervals, model.robot.tree
    content = {
        **MODEL.header,
        "consistent": model.consistent,
        "origin": model.origin,
        "notes": model.notes,
        "units": UNITS,
        "conventions": CONVENTIONS,
        "links": [_link_values(model, i) for i in range(tree.size)],
        "parameters": [
            {
                "name": p.name,
                "value": float(value),
                "interval": None if intervals is None else intervals[k],
                "unit": p.unit,
                "joint": tree.joints[p.joint].name,
            }
            for k, (p, value) in enumerate(zip(model.parameters, model.values, strict=True))
        ],
        "base_parameters": list(_base_values(model)),
        "robot": robot_values(robot_with_values(model)),
    }
    return plain(content)


def robot_with_values(model: RunnableModel) -> Robot:
    """The robot with the model's values as nominal inertias, rotor inertias and friction."""
    robot, friction = model.robot, dict[str, float]()
    rotor = np.zeros(robot.tree.size)
    for p, value in zip(model.parameters, model.values.tolist(), strict=True):
        if p.stem == "ia":
            rotor[p.joint] = value
        elif not p.is_inertial:
            friction[p.name] = value
    links = [replace(k, inertia=model.inertial(i)) for i, k in enumerate(robot.tree.links)]
    passive = [i for i in range(len(links)) if i not in robot.places]
    return replace(
        robot,
        links=tuple(links[i] for i in robot.places),
        passive_links=tuple(links[i] for i in passive),
        rotor_inertia=rotor[list(robot.places)],
        friction_nominal=friction,
    )


def read_model(path: str | PathLike[str]) -> RunnableModel:
    """The model that `to_json` has written, exactly, without intervals.

    Args:
        path: the file.

    Returns:
        The model.

    Raises:
        IdentificationFileError: it cannot be read, or is no model of this layout.
    """
    from pivident.estimation.stored_identification import json_of_file

    return _model_of(json_of_file(Path(path)), str(path))


def verify_json(exported: ExportedText, model: RunnableModel) -> Verification:
    """Torques from the file's masses, centres of mass and inertias against the model's."""
    content = json.loads(exported.content)
    loaded = _model_of(content, "the exported JSON")
    value = {entry["name"]: entry["value"] for entry in content["parameters"]}
    for i, link in enumerate(content["links"]):
        if link["mass"] == 0.0:
            continue
        center, inertia = np.array(link["center_of_mass"]), np.array(link["inertia"])
        ten = from_center_of_mass(link["mass"], center, inertia)
        own = [p for p in model.parameters if p.joint == i and p.is_inertial]
        value |= {p.name: float(ten[INERTIAL.index(p.stem)]) for p in own}
    values = np.array([value[p.name] for p in model.parameters])
    return compared(
        "pivident, from the file",
        model.robot,
        model.torque,
        lambda q, dq, ddq: loaded.regressor.torque(q, dq, ddq, values),
    )


def _model_of(content: dict[str, Any], file: str) -> RunnableModel:
    with MODEL.damage(file):
        known = decode(ModelTable, MODEL.raised(content, file))
        nominal = runnable_model(known.robot)
        values = {entry.name: entry.value for entry in known.parameters}
        own = {p.name: v for p, v in zip(nominal.parameters, nominal.values.tolist(), strict=True)}
        for name in (*own, *values):
            if values.get(name) != own.get(name):
                raise UnusableValue(
                    f"the parameter {name} is {values.get(name)!r} in 'parameters' and "
                    f"{own.get(name)!r} in 'robot'"
                )
        same = {key: getattr(known, key) for key in ("consistent", "origin", "notes")}
        model = replace(nominal, **same)
        if known.consistent and (wrong := impossible_value(model)):
            raise UnusableValue(f"it is marked as physically consistent, but {wrong}")
    return model


def _link_values(model: RunnableModel, joint: int) -> dict[str, Any]:
    body = model.link(joint)
    return {
        "name": model.robot.tree.links[joint].name,
        "joint": model.robot.tree.joints[joint].name,
        "mass": body.mass,
        "center_of_mass": body.center_of_mass if body.mass else None,
        "first_moments": model.inertial(joint)[6:9],
        "inertia": body.inertia,
        "inertia_at_origin": tensor(model.inertial(joint)[:6]),
    }


def _base_values(model: RunnableModel) -> Iterator[dict[str, Any]]:
    """Every base parameter: its value here, and the free estimate with its interval."""
    found: dict[str, tuple[float, float]] = {}
    if model.estimate is not None:
        columns = (model.estimate.names, model.estimate.theta, model.estimate.std)
        found = {n: (float(v), float(s)) for n, v, s in zip(*columns, strict=True)}
    rows = zip(
        model.base.names, model.base.expressions, model.base.parameters, model.base_values,
        strict=True,
    )  # fmt: skip
    for name, group, p, value in rows:
        estimate, std = found.get(name, (math.nan, math.nan))
        spread = 1.959963984540054 * std
        yield {
            "name": name,
            "group": group,
            "value": float(value),
            "estimate": estimate,
            "interval": (estimate - spread, estimate + spread) if math.isfinite(spread) else None,
            "unit": p.unit,
        }


#: The format from which pivident reads a model back.
JSON = Format(
    "JSON",
    ".json",
    lambda model, _: to_json(model),
    (lambda file, model, _: verify_json(file, model),),
    holds_base=True,
    shows_intervals=True,
)
