"""An identification from its file: everything but the signals.

What `identification_file` writes is read back, and checked as if a stranger had written it:
types, shapes, finite numbers, symmetric covariances, and parameters that are base parameters of
the robot in the file. The result predicts torques, prints, is made consistent and exported like
the one that `identify` returned. Its recordings, equations and loop are not there, and tests that
need them say so.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from pivident.dynamics.base_parameters import BaseParameters, base_parameters, regrouped_name
from pivident.dynamics.grouping.closed_form import quick_base_parameters
from pivident.estimation.equation_record import MotionRange
from pivident.estimation.identification import Identification, Iteration, JointFit
from pivident.estimation.identification_file import SCHEMA, method_of_options
from pivident.estimation.simulation_result import SimulationResult
from pivident.estimation.solved_equations import EquationNoise, TorqueSums
from pivident.foundation.errors import IdentificationFileError, PividentError, UnusableValue
from pivident.foundation.files import json_object
from pivident.foundation.text.finding import Finding, Quantity, Severity
from pivident.loop.instruments.given_motion import InstrumentsUsed
from pivident.loop.instruments.kinds import KINDS
from pivident.robot.description import Robot, TorqueSide
from pivident.robot.naming import nearest
from pivident.robot.robot_schema import Finite, Name, RobotValues, Values, first_problem
from pivident.robot.robot_values import made_robot

#: Larger files are not identifications [bytes].
MAX_FILE = 2**27

#: Largest asymmetry of a covariance, relative to its standard errors, and most negative eigenvalue
#: of its correlations that the rounding of versions explains which wrote what they had computed:
#: up to κ²ε at the largest condition number that is solved, 1e6.
ASYMMETRY = INDEFINITE = 1e-3

#: The first layout, which did not hold the robot.
WITHOUT_ROBOT = 1

#: A number that is written as null where it is not finite.
Known = Finite | None
Matrix = list[list[Known]]


class ParameterValues(Values):
    """One estimate; its standard errors are those of the covariances.

    Up to schema 3 ``std`` was by the method's covariance, and ``robust_std`` stood beside it.
    """

    name: Name
    value: Finite
    std: Known
    low: Known = None
    high: Known = None
    robust_std: Known = None
    relative_std: Known
    method_std: Known = None
    unit: str
    expression: str


class JointFitValues(Values):
    """How one joint was fitted."""

    name: Name
    torque_unit: str
    relative_error: Known
    rms_error: Known
    noise_std: Known
    noise_unit: str
    ar_order: int
    ar_at_bound: bool
    rows: Annotated[int, Field(ge=0)]
    masked: Known
    f50: Known
    encoder_std: Known


class IterationValues(Values):
    """One pass of the estimator."""

    theta: list[Known]
    change: Known
    residual: Known
    halvings: int
    ar_orders: list[int]


class QuantityValues(Values):
    """A number behind a warning."""

    value: Known
    unit: str = ""
    bound: Known = None
    interval: Annotated[list[Known], Field(min_length=2, max_length=2)] | None = None


class WarningValues(Values):
    """What the estimator noticed; repairs are of the experiment file of that run, and left out."""

    severity: Severity
    topic: str
    kind: str
    message: str
    subject: str = ""
    next_step: str = ""
    evidence: Annotated[dict[str, QuantityValues], Field(default_factory=dict)]
    basis: str = ""
    place: list[str | int] = Field(default_factory=list)
    repairs: list[Any] = Field(default_factory=list)


class InstrumentsValues(Values):
    """Where the instruments came from."""

    kind: Literal[tuple(KINDS)]  # type: ignore[valid-type]
    found: list[str]
    agreement: list[Known]
    shares_noise: str
    others: list[Annotated[list[str], Field(min_length=2, max_length=2)]]
    instead_of: str


class ReadingValues(Values):
    """How a log was read: arguments of `load_recording`."""

    columns: dict[str, Any]
    units: dict[str, Any]
    side: str | dict[str, str]
    rate: Finite | None
    resample: bool
    samples_axis: int | None
    position_offset: list[Finite] | None
    control_rate: Finite | None = None
    torque_timing: str | None = None
    delay: Finite | None = None
    drive_delay: Finite | None = None
    torque_side: TorqueSide | None = None


class FileContent(Values):
    """The whole file."""

    schema_: Annotated[int, Field(alias="schema")]
    method: Name
    kind: str | None = None
    robot: Name
    converged: bool
    iterations: int
    parameters: Annotated[list[ParameterValues], Field(min_length=1)]
    covariance: Matrix
    robust_covariance: Matrix
    formula_covariance: Matrix
    relative_error: Known
    joints: list[JointFitValues]
    history: list[IterationValues]
    condition: Known
    controller: list[dict[str, Any]] | None
    reference: list[dict[str, Any]] | None
    instruments: InstrumentsValues | None = None
    options: dict[str, Any]
    warnings: list[WarningValues | str]
    sources: dict[str, str]
    version: str
    readings: list[ReadingValues] = Field(default_factory=list)
    motion: dict[str, list[Finite]] | None = None
    robot_description: RobotValues | None = None
    torque_sums: dict[str, Any] | None = None
    equation_noise: dict[str, Any] | None = None
    simulation: dict[str, Any] | None = None


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
    """
    file = Path(path)
    if file.is_dir():
        file = file / "identification.json"
    try:
        return _identification(_content(file, robot), robot)
    except IdentificationFileError:
        raise
    except (ValidationError, PividentError) as error:
        raise IdentificationFileError.of_content(
            str(file),
            first_problem(error),
            "the file is damaged or was changed by hand, identify again",
        ) from (None if isinstance(error, ValidationError) else error)
    except (ValueError, OverflowError) as error:
        raise IdentificationFileError.of_content(str(file), error, "") from error


def json_of_file(file: Path) -> dict[str, Any]:
    """A JSON object as plain values."""
    try:
        return json_object(file, MAX_FILE)
    except OSError as error:
        several = sorted(p.parent.name for p in file.parent.glob("*/identification.json"))
        advice = "check the path and its permissions"
        if several:
            advice = f"there is one for each method: {', '.join(map(repr, several))}; name one"
        raise IdentificationFileError(
            str(file), f"cannot be read ({error.strerror})", advice=advice
        ) from error
    except ValueError as error:
        raise IdentificationFileError(
            str(file),
            str(error),
            advice="give the file identification.json of a result, or write it again with "
            "`pivident identify`",
        ) from None


def _content(file: Path, robot: Robot | None) -> FileContent:
    """The checked content of a file whose layout this version knows."""
    content = json_of_file(file)
    schema = content.get("schema")
    if type(schema) is not int or "covariance" not in content:
        raise IdentificationFileError(
            str(file),
            "is not an identification: it has no schema number or covariance",
            advice="give the file identification.json of a result",
        )
    if schema > SCHEMA:
        raise IdentificationFileError(
            str(file),
            f"has layout {schema}, this version reads up to {SCHEMA}",
            advice="install a newer pivident",
        )
    if schema <= WITHOUT_ROBOT and robot is None:
        raise IdentificationFileError(
            str(file),
            f"has layout {schema}, written by an older version, which did not keep the robot",
            advice="identify again, or give the robot: load_identification(path, robot=…)",
        )
    if schema > WITHOUT_ROBOT and robot is not None:
        raise IdentificationFileError(
            str(file), "holds its robot already", advice="leave the argument robot out"
        )
    if schema > WITHOUT_ROBOT and not isinstance(content.get("robot_description"), dict):
        raise IdentificationFileError(
            str(file), "the key 'robot_description' is missing", advice="identify again"
        )
    return FileContent.model_validate(content)


def _identification(content: FileContent, robot: Robot | None) -> Identification:
    if content.robot_description is not None:
        robot = made_robot(content.robot_description)
    assert robot is not None
    if [fit.name for fit in content.joints] != list(robot.joint_names):
        raise UnusableValue(
            f"joints are {', '.join(fit.name for fit in content.joints)}, but those of the robot "
            f"are {', '.join(robot.joint_names)}",
            advice="identify again",
        )
    if not isinstance(content.options.get("signals", {}), dict):
        raise UnusableValue(
            "options.signals must be a dictionary of options", advice="identify again"
        )
    n = len(content.parameters)
    covariance = _covariance("covariance", content.covariance, n)
    robust = _covariance("robust_covariance", content.robust_covariance, n)
    formula = _covariance("formula_covariance", content.formula_covariance, n)
    history = tuple(_iteration(entry, n) for entry in content.history)
    base, chosen = _selection(robot, [p.name for p in content.parameters])
    return Identification(
        method=content.method,
        robot=robot,
        parameters=tuple(base.parameters[k] for k in chosen),
        names=tuple(base.names[k] for k in chosen),
        expressions=tuple(base.expressions[k] for k in chosen),
        theta=np.array([p.value for p in content.parameters]),
        covariance=covariance,
        robust_covariance=robust,
        formula_covariance=formula,
        converged=content.converged,
        history=history,
        joints=tuple(_joint_fit(fit) for fit in content.joints),
        relative_error=_number(content.relative_error),
        condition=_number(content.condition, math.inf),
        recordings=(),
        options=content.options,
        method_used=method_of_options(content.options, content.kind, content.method),
        warnings=tuple(map(_warning, content.warnings)),
        sources=content.sources,
        version=content.version,
        readings=tuple(r.model_dump(exclude_unset=True) for r in content.readings),
        motion=_motion(content.motion, robot.size),
        torque_sums=_torque_sums(content.torque_sums, base),
        equation_noise=_equation_noise(content.equation_noise, robot.size),
        simulation=_simulation(content.simulation, robot.size),
        instruments=_instruments(content.instruments),
        loop_values={"controller": content.controller, "reference": content.reference},
    )


def _selection(robot: Robot, names: list[str]) -> tuple[BaseParameters, list[int]]:
    """The robot's base parameters, and the places of the estimated ones among them, in order.

    They are taken from the closed form, which takes a tenth of the time of the numerical search on
    robots of many joints. Geometry at the edge of a tolerance can make the two differ: where the
    file has other groups that this robot could have, they are searched for.
    """
    base = quick_base_parameters(robot)
    heads = {text for p in base.standard for text in (p.name, regrouped_name(p))}
    if not set(base.names).issuperset(names) and heads.issuperset(names):
        base = base_parameters(robot)
    known = {name: k for k, name in enumerate(base.names)}
    for name in names:
        if name not in known:
            raise UnusableValue(
                f"{name!r} is not a base parameter of the robot {robot.name!r}",
                advice=nearest(name, known),
            )
    chosen = [known[name] for name in names]
    if sorted(set(chosen)) != chosen:
        raise UnusableValue(
            f"the parameters {', '.join(names)} are not in the robot's order, each once",
            advice="identify again",
        )
    return base, chosen


def _covariance(key: str, rows: Matrix, size: int) -> np.ndarray:
    """A covariance matrix; one that was not finite when it was written is NaN throughout."""
    if len(rows) != size or any(len(row) != size for row in rows):
        raise UnusableValue(
            f"{key} has {len(rows)} rows of {sorted({len(row) for row in rows})} numbers",
            advice=f"the {size} parameters need shape {(size, size)}; identify again",
        )
    matrix = np.array([[_number(x) for x in row] for row in rows])
    if not np.isfinite(matrix).all():
        return np.full((size, size), np.nan)
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


def _iteration(values: IterationValues, size: int) -> Iteration:
    if len(values.theta) != size:
        raise UnusableValue(
            f"an iteration of the history has {len(values.theta)} parameters instead of {size}",
            advice="identify again",
        )
    return Iteration(
        theta=np.array([_number(x) for x in values.theta]),
        change=_number(values.change, math.inf),
        residual=_number(values.residual),
        halvings=values.halvings,
        ar_orders=tuple(values.ar_orders),
    )


def _joint_fit(values: JointFitValues) -> JointFit:
    unknown = {key: math.nan for key, value in vars(values).items() if value is None}
    return JointFit(**vars(values) | unknown)


def _torque_sums(values: dict[str, Any] | None, base: BaseParameters) -> Any:
    if values is None:
        return None
    return TorqueSums.from_values(values, base)


def _equation_noise(values: dict[str, Any] | None, joints: int) -> EquationNoise | None:
    return None if values is None else EquationNoise.from_values(values, joints)


def _simulation(values: dict[str, Any] | None, joints: int) -> SimulationResult | None:
    return None if values is None else SimulationResult.from_values(values, joints)


def _instruments(values: InstrumentsValues | None) -> InstrumentsUsed | None:
    if values is None:
        return None
    known = tuple(_number(a) for a in values.agreement)
    return InstrumentsUsed.from_values(dict(values) | {"agreement": known})


def _motion(values: dict[str, list[float]] | None, joints: int) -> MotionRange | None:
    return None if values is None else MotionRange.from_values(values, joints)


def _number(value: float | None, unknown: float = math.nan) -> float:
    return unknown if value is None else float(value)


def _warning(stored: WarningValues | str) -> Finding:
    """A warning of a file; older files hold sentences."""
    if isinstance(stored, str):
        return Finding("warning", "estimator", "stored", stored)
    evidence = {name: _quantity(own) for name, own in stored.evidence.items()}
    place = tuple(stored.place)
    return Finding(**dict(stored) | {"evidence": evidence, "place": place, "repairs": ()})


def _quantity(stored: QuantityValues) -> Quantity:
    interval = stored.interval
    return Quantity(
        _number(stored.value),
        stored.unit,
        stored.bound,
        None if interval is None else (_number(interval[0]), _number(interval[1])),
    )
