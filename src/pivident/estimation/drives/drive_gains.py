"""Drive gains of all joints, as far as a record determines them.

    two records, without and with a known payload      the gains
    a trusted gain, or a trusted parameter             the gains of everything connected to it
    a force sensor under the base                      the gains: its rows are in N and N m
    one record alone                                   ratios of gains, and free scales

The estimate is that of `pivident.estimation.drives.gain_equations`: commands are the regressand,
not regressors, with instruments from the simulated loop where the control law is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.regressor import Regressor
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.drives import gain_equations as bilinear
from pivident.estimation.drives.drive_equations import (
    DriveRecord,
    GainUnknowns,
    Trusted,
    drive_sums,
    gain_unknowns,
    refuse_load_friction,
)
from pivident.estimation.drives.gain_equations import GainEquations, gains_by, homogeneous_start
from pivident.estimation.drives.known_payload import Payload
from pivident.estimation.drives.log_units import KNOWN_WITHIN, GainGroup, gain_groups, ratio
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import (
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.foundation.text.display import Displayed
from pivident.robot.refusals import without_wrenches
from pivident.robot.wrench_sensor import BASE

#: Rounds of simulation; gains that change by less than this many standard errors have converged.
MAX_ROUNDS, CONVERGED = 8, 0.05


@dataclass(frozen=True, eq=False)
class DriveGains(Displayed):
    """Gains of all motors with what is known of them.

    Attributes:
        joints: names of the joints.
        kappa: N m (or N) on the joint side per unit of the log, shape (joints,); where a motor's
            group is not anchored, only ratios within its group mean anything.
        log_covariance: covariance of log |κ|, shape (joints, joints).
        groups: which gains are known relative to which; the anchored group first.
        known_within: half width of the 2σ interval below which a gain or ratio is called known.
        literature: gains by weighted and total least squares and their standard errors, by name;
            empty without a payload or a trusted parameter.
        residual: ‖c - model‖/‖c‖ of each motor with common parameters, shape (joints,).
        own_residual: the same with parameters of each motor's own, shape (joints,).
        method: ``instrumental variables`` (with the simulated loop) or ``least squares``.
        rounds: rounds of simulation.
        warnings: what the estimator noticed, whole sentences.
    """

    joints: tuple[str, ...]
    kappa: np.ndarray
    log_covariance: np.ndarray  # of log |κ|, (joints, joints)
    groups: tuple[GainGroup, ...]  # gains known relative to each other; the anchored group first
    known_within: float  # half width of the 2σ interval of a known gain or ratio
    literature: Mapping[str, tuple[np.ndarray, np.ndarray]]
    residual: np.ndarray  # ‖c - model‖/‖c‖ with common parameters, (joints,)
    own_residual: np.ndarray  # the same with each motor's own parameters, (joints,)
    method: str
    rounds: int = 0  # of simulation
    warnings: tuple[str, ...] = ()  # complete sentences

    @property
    def std(self) -> np.ndarray:
        """Standard errors of κ, shape (joints,); meaningless outside the anchored group."""
        return np.abs(self.kappa) * np.sqrt(np.diag(self.log_covariance))

    @property
    def anchored(self) -> np.ndarray:
        """Whether each gain itself is known, shape (joints,)."""
        known = np.zeros(len(self.joints), dtype=bool)
        for group in self.groups:
            known[list(group.motors)] = group.anchored
        return known

    def ratio(self, joint: int, reference: int) -> tuple[float, float]:
        """κ_joint/κ_reference and its standard error, of the joints with these indices.

        Args:
            joint: index of the joint above the bar.
            reference: index of the joint below it.
        """
        return ratio(self.kappa, self.log_covariance, joint, reference)


def identify_drive_gains(
    problem: Problem,
    payload: Payload | None = None,
    loaded: Sequence[Recording] = (),
    *,
    trusted_gains: Mapping[str, Trusted | float] | None = None,
    trusted_parameters: Mapping[str, Trusted | float] | None = None,
    friction_under_load: bool = True,
    known_within: float = KNOWN_WITHIN,
    signals: RandomWalk | None = None,
    progress: Callable[[str], None] | None = None,
) -> DriveGains:
    """Gains κ of tau = B (κ ∘ c), see the module's docstring.

    Args:
        problem: robot, recordings without payload, loop, parameters. ``tau`` of the recordings is
            the command in the unit of the log. With a loop, its law acts on that command: the
            simulated torque is κ times the loop's drive gain times the law's output.
        payload: the body that the loaded recordings were taken with.
        loaded: recordings with the payload.
        trusted_gains: κ of joints that is believed, by name.
        trusted_parameters: base parameters that are believed, by name [SI].
        friction_under_load: whether friction may be another one with the payload.
        known_within: half width of the 2σ interval below which a gain or ratio is called known.
        signals: the smoother; default: random walk with the torque aligned.
        progress: called with one line at each stage.

    Returns:
        Gains, covariance, groups.

    Raises:
        ExperimentError: payload and recordings that do not go together, unknown names.
        IdentificationError: a motor with too few rows, or gains that do not settle.
    """
    for recording in (*problem.recordings, *loaded):
        recording.require_torque("drive gains are found")
    say = progress or (lambda line: None)
    refuse_load_friction(problem.regressor)
    if any(sensor.link != BASE for sensor in problem.robot.sensors):
        without_wrenches(problem.robot, "the search for drive gains with a sensor at a link")
    base = problem.robot.joint_names[: problem.robot.base_joints]
    trusted_gains = dict.fromkeys(base, 1.0) | dict(trusted_gains or {})
    setting = gain_unknowns(
        problem, payload, loaded, trusted_gains, trusted_parameters or {}, friction_under_load
    )
    say("drive gains: smoothing the records")
    wide = setting.wide
    records = [
        DriveRecord(estimate_kinematics(r, signals or RandomWalk()), problem.speed_limits(r), load)
        for r, load in zip(wide.recordings, setting.loads, strict=True)
    ]
    regressor = wide.regressor
    sums = drive_sums(wide.robot, regressor, records)
    _check_rows(sums)
    equations = _equations(setting, regressor, sums)
    say("drive gains: least squares")
    ell, x = _start(equations)
    warnings = _sign_warnings(problem, equations)
    method, rounds = "least squares", 0
    if problem.loop is not None:
        try:
            equations, ell, x, rounds = _with_instruments(
                setting, regressor, records, equations, ell, x, say
            )
            method = "instrumental variables"
        except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
            warnings.append(
                f"The loop could not be simulated ({error}); the gains are those of least squares, "
                "which noise in the loop may bias."
            )
    own = slice(len(base), None)  # joints with drives
    spread = _covariance(setting, equations, ell, x)
    groups = gain_groups(spread, known_within)
    return DriveGains(
        joints=problem.robot.joint_names[own],
        kappa=(equations.signs * np.exp(ell))[own],
        log_covariance=spread[own, own],
        groups=tuple(_of_drives(groups, len(base))),
        known_within=known_within,
        literature={
            name: (kappa[own], std[own])
            for name, (kappa, std) in _literature(equations, ell).items()
        },
        residual=_residuals(equations, ell, x)[own],
        own_residual=_own_residuals(equations)[own],
        method=method,
        rounds=rounds,
        warnings=tuple(warnings),
    )


def _of_drives(groups: Sequence[GainGroup], base: int) -> Iterator[GainGroup]:
    """Groups without the rows of a measured base, whose gains nobody asks for."""
    for group in groups:
        motors = tuple(m - base for m in group.motors if m >= base)
        if motors:
            yield GainGroup(motors, group.anchored, max(group.reference - base, motors[0]))


def _check_rows(sums: Sequence[Sequence[JointSums]]) -> None:
    """Refuse a motor with too few valid rows."""
    for loaded in sums:
        for own in loaded:
            if own.rows <= own.columns.size:
                raise IdentificationError(
                    f"joint {own.name!r} has {own.rows} usable rows for {own.columns.size} "
                    "parameters: it hardly moves faster than the low-speed mask, or the record "
                    "is too short",
                    advice="lower the mask, or take a longer record",
                )


def _equations(
    setting: GainUnknowns, regressor: Regressor, sums: list[list[JointSums]]
) -> GainEquations:
    """The bilinear model, weighted by the residual of each row's own parameters."""
    robot = setting.wide.robot
    variances = np.array([[own.own_variance() for own in loaded] for loaded in sums])
    signs = np.array([_sign(regressor, sums, m) for m in range(robot.size)])
    centre, trusted = np.zeros(robot.size), np.full(robot.size, np.inf)
    for m, number in setting.trusted_gains.items():
        centre[m], signs[m] = np.log(abs(number.value)), np.sign(number.value)
        # an exact gain counts as known to a millionth
        trusted[m] = max(number.std / abs(number.value), 1e-6)
    return GainEquations(sums, setting.maps, setting.offsets, signs, variances, centre, trusted)


def _sign(regressor: Regressor, sums: Sequence[Sequence[JointSums]], motor: int) -> float:
    """Sign of a gain: with the right one friction brakes and rotor inertias are positive."""
    score = 0.0
    for loaded in sums:
        own = loaded[motor]
        scale = np.sqrt(np.maximum(np.diag(own.ff), 1e-300))
        inverse = np.linalg.pinv(own.ff / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        significance = inverse @ (own.ft / scale) / np.sqrt(np.maximum(np.diag(inverse), 1e-300))
        score += sum(
            value
            for value, c in zip(significance, own.columns, strict=True)
            if regressor.parameters[c].is_dissipative
        )
    return -1.0 if score < 0 else 1.0


def _sign_warnings(problem: Problem, equations: GainEquations) -> list[str]:
    turned = [
        name for name, s in zip(problem.robot.joint_names, equations.signs, strict=True) if s < 0
    ]
    if not turned:
        return []
    return [
        f"The command of {', '.join(turned)} has the opposite sign of its torque: with it friction "
        "would push. Check the sign of that column or of the reduction."
    ]


def _start(equations: GainEquations) -> tuple[np.ndarray, np.ndarray]:
    """Least squares from the declared gains and from those of the literature, the better one."""
    starts = [np.where(np.isfinite(equations.trusted), equations.centre, 0.0)]
    starts.append(homogeneous_start(equations))
    if any(np.any(b) for b in equations.offsets):
        kappa, _ = gains_by("wls", equations, np.exp(starts[1]))
        starts.append(np.log(np.maximum(np.abs(kappa), 1e-3 * np.abs(kappa).max())))
    found: list[tuple[float, int, np.ndarray, np.ndarray]] = []
    for start in starts:
        centred = replace(
            equations, centre=np.where(np.isfinite(equations.trusted), equations.centre, start)
        )
        ell, x = bilinear.least_squares(centred, start)
        found.append((bilinear.cost(centred, ell, x), len(found), ell, x))
    _, _, ell, x = min(found, key=lambda one: one[:2])
    return ell, x


def _with_instruments(
    setting: GainUnknowns,
    regressor: Regressor,
    records: Sequence[DriveRecord],
    equations: GainEquations,
    ell: np.ndarray,
    x: np.ndarray,
    say: Callable[[str], None],
) -> tuple[GainEquations, np.ndarray, np.ndarray, int]:
    """Simulate the loop under both loads, solve with its motion as instruments, repeat."""
    for k in range(MAX_ROUNDS):
        moved = _simulated(setting, records, equations, ell, x)
        sums = drive_sums(setting.wide.robot, regressor, moved)
        _check_rows(sums)
        equations = replace(equations, sums=sums)
        before, (ell, x) = ell, bilinear.instrumental_variables(equations, ell, x)
        spread = bilinear.covariance(equations, ell, x)[: ell.size, : ell.size]
        change = float((np.abs(ell - before) / np.sqrt(np.diag(spread))).max())
        say(f"drive gains: round {k + 1}, gains change by {change:.2g} standard errors")
        if change < CONVERGED:
            break
    return equations, ell, x, k + 1


def _simulated(
    setting: GainUnknowns,
    records: Sequence[DriveRecord],
    equations: GainEquations,
    ell: np.ndarray,
    x: np.ndarray,
) -> list[DriveRecord]:
    """The records with the motion of the loop simulated under their load."""
    wide, kappa = setting.wide, equations.signs * np.exp(ell)
    assert wide.loop is not None
    loop = replace(
        wide.loop,
        drive_gain=np.asarray(wide.loop.drive_gain) * np.abs(kappa[wide.robot.base_joints :]),
        limit=wide.loop.limit,
    )
    made: dict[int, DriveRecord] = {}
    for load, (M, b) in enumerate(zip(setting.maps, setting.offsets, strict=True)):
        mine = [k for k, own in enumerate(setting.loads) if own == load]
        recordings = tuple(wide.recordings[k] for k in mine)
        part = replace(wide, recordings=recordings, loop=loop, initial={})
        auxiliary = AuxiliaryModel(
            part, differences=True, kinematics=[records[k].kinematics for k in mine]
        )
        made |= {
            k: replace(records[k], motion=motion)
            for k, motion in zip(mine, auxiliary.simulate(M @ x + b), strict=True)
        }
    return [made[k] for k in range(len(records))]


def _covariance(
    setting: GainUnknowns, equations: GainEquations, ell: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Covariance of the log gains, uncertainty of the trusted values included."""
    n = ell.size
    spread = bilinear.covariance(equations, ell, x)[:n, :n]
    for std, directions in setting.directions:
        if std > 0:
            change = bilinear.sensitivity(equations, ell, x, directions)[:n]
            spread = spread + std**2 * np.outer(change, change)
    return 0.5 * (spread + spread.T)


def _literature(
    equations: GainEquations, ell: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The same gains by weighted and total least squares, where a load is known."""
    if not any(np.any(b) for b in equations.offsets):
        return {}
    kappa = np.exp(ell)
    return {name: gains_by(name, equations, kappa) for name in ("wls", "tls", "mixed-tls")}


def _residuals(equations: GainEquations, ell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """‖c - νΦθ‖/‖c‖ of each motor over all loads."""
    nu = equations.rate(ell)
    left, total = np.zeros((2, equations.motors))
    for _, m, own, M, b in equations.rows():
        left[m] += bilinear.residual_sum(own, nu[m] * (M @ x + b))
        total[m] += own.tt
    return np.sqrt(left / np.maximum(total, 1e-300))


def _own_residuals(equations: GainEquations) -> np.ndarray:
    """The same with separate parameters for each row."""
    left, total = np.zeros((2, equations.motors))
    for g, m, own, _, _ in equations.rows():
        left[m] += equations.variances[g, m] * max(own.rows - own.columns.size, 1)
        total[m] += own.tt
    return np.sqrt(left / np.maximum(total, 1e-300))
