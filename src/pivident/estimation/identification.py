"""The answer: estimated parameters, covariance, sums of the record, and all that judges them.

Sums of the fitted record of an identification, and its estimate among all base parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, nan
from typing import Annotated, Any

import numpy as np

from pivident.data.logs.torque_scale import MASSES, TorqueScale
from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.friction import FrictionWarming
from pivident.dynamics.inverse_dynamics import InverseDynamics
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.covariance import rounded_away
from pivident.estimation.equation_record import FittedRecording, MotionRange
from pivident.estimation.known_parameters import KnownParameters
from pivident.estimation.method import Method
from pivident.estimation.restrictions import Restrictions
from pivident.estimation.signal_recipes import Decimated
from pivident.estimation.simulation_result import SimulationResult
from pivident.estimation.solved_equations import EquationNoise, Equations, TorqueSums
from pivident.foundation.document.estimated import Estimated
from pivident.foundation.errors import UnknownName, UnusableValue
from pivident.foundation.text import display
from pivident.foundation.text.display import Displayed, Summary, in_one_line
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.plain_values import Known, Limits, Name, Null, Sized
from pivident.loop.instruments.given_motion import InstrumentsUsed
from pivident.loop.simulation.control_loop import Loop
from pivident.robot.description import Robot
from pivident.robot.naming import nearest

#: Samples that are worked on at a time.
BLOCK = 4096


@dataclass(frozen=True, eq=False)
class Iteration(Displayed):
    """One pass of an iterative estimator."""

    #: Parameters after it, shape (parameters,).
    theta: Annotated[np.ndarray, Sized("parameters"), Null(nan)]
    change: Annotated[float, Null(inf)]  # largest |Δθ| / max(|θ|, 2σ)
    #: Relative error of the reconstructed torque, weighted as in the estimate; where a simulation
    #: is fitted, rms of its weighted errors before the step, 1 where they are as large as noise.
    residual: Known
    #: How often the step had to be halved before the loop could be simulated, or was taken back.
    halvings: int = 0
    #: Orders of the noise models used, one per joint, empty without noise models.
    ar_orders: tuple[int, ...] = ()


@dataclass(frozen=True)
class JointFit:
    """How one joint was fitted."""

    name: Name  # joint
    torque_unit: str  # N m or N
    #: ‖τ - Φθ‖/‖τ‖ over the rows that the estimate used, unfiltered by the noise model.
    relative_error: Known
    rms_error: Known  # rms of τ - Φθ over the same rows [torque_unit]
    #: Standard deviation of the innovations, in the unit of the filtered equation
    #: (the joint's torque, or the encoder where the controller was inverted).
    noise_std: Known
    noise_unit: str  # that unit
    ar_order: int  # order of the noise model; 0 without one
    ar_at_bound: bool  # whether the order criterion had its minimum at the largest order allowed
    rows: Annotated[int, Limits(ge=0)]  # number of rows (samples) used
    masked: Known  # share of the samples left out at low speed, 0 to 1
    f50: Known  # half-power frequency of the position smoother [Hz], NaN with a fixed band-pass
    encoder_std: Known  # measurement noise found by the smoother [rad or m], NaN likewise


@dataclass(frozen=True, eq=False)
class Identification(Estimated, Displayed):
    """Estimated base parameters with everything that came with them.

    Attributes:
        method: name of the method as the papers call it (``IDIM-PIV``).
        robot: the robot.
        parameters: heads of the estimated groups.
        names: names of the base parameters (``zz1r``).
        expressions: their groups written out.
        theta: estimates, shape (parameters,).
        covariance: covariance of the estimate, shape (parameters, parameters): the sandwich with
            IDIM-PIV, the formula with the others; free of what rounding adds, as the other two are.
        robust_covariance: sandwich over windows of time, which holds for residuals that are
            correlated and of changing variance, of the shape of ``covariance``.
        formula_covariance: (P-31) summed over samples, which holds for white ones.
        converged: whether the iteration met both criteria (a single solution always has).
        history: iterations, the last one first to hold the estimate.
        joints: fit of each joint.
        relative_error: ‖τ - Φθ‖/‖τ‖ over all joints, weighted as in the estimate.
        condition: condition number of the column-scaled observation matrix.
        recordings: signals for plots.
        options: the method's options and the problem's ``mask`` as plain values.
        method_used: the method itself; None: from a file whose options are of no known method.
        warnings: what the estimator noticed.
        sources: SHA-256 of every input file by its name.
        version: version of pivident.
        readings: arguments of `load_recording` but the files, by which its logs were read; empty
            where they were arrays.
        motion: range of the fitted motion; that of a loaded identification, whose signals are not
            there.
        loop: control loop that was simulated for the instruments; None: no loop was, or the
            identification was loaded, see ``loop_in_words``.
        instruments: where the instruments come from; None: there are none.
        equations: what the last pass was made of, for tests of instruments and covariances.
        torque_sums: sums of the fitted record from which the torque error of other parameters
            follows; those of a loaded identification, whose signals are not there.
        equation_noise: noise of the equations by joint, for the design of the next motion; None
            in files of versions that did not write it.
        simulation: how near a fitted simulation comes, with the unknowns of its loop; None: nothing
            was fitted by simulation.
        known: what was known of the parameters beforehand: fixed values, bounds, priors, equations.
        friction_warming: how friction changes with temperature; its parameters are those at the
            reference, see `pivident.judgement.corrections`.
        loop_values: ``controller``, ``reference`` and ``loop`` as the file of a loaded
            identification holds them; None for an identification that was made here.
        judged: parameters that errors and covariances belong to, those of the result.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> result = pv.identify(pv.Problem(robot, (recording,), loop), "piv")
        >>> round(result.params["fc1"], 2), result.units[result.names.index("fc1")]
        (4.0, 'N m')
        >>> result.torque(q=[0.0, 0.0], dq=[0.5, 0.0], ddq=[0.0, 0.0]).round(1)  # [N m]
        array([26.9,  3.5])
    """

    method: str
    robot: Robot
    parameters: tuple[Parameter, ...]
    names: tuple[str, ...]
    expressions: tuple[str, ...]
    theta: np.ndarray
    covariance: np.ndarray
    robust_covariance: np.ndarray
    formula_covariance: np.ndarray
    converged: bool
    history: tuple[Iteration, ...]
    joints: tuple[JointFit, ...]
    relative_error: float
    condition: float
    recordings: tuple[FittedRecording, ...]
    options: dict[str, Any] = field(default_factory=dict)
    method_used: Method | None = None
    warnings: tuple[Finding, ...] = ()
    sources: dict[str, str] = field(default_factory=dict)
    version: str = ""
    readings: tuple[dict[str, Any], ...] = field(default=(), repr=False)
    motion: MotionRange | None = field(default=None, repr=False)
    loop: Loop | None = None
    instruments: InstrumentsUsed | None = None
    equations: Equations | None = field(default=None, repr=False)
    torque_sums: TorqueSums | None = field(default=None, repr=False)
    equation_noise: EquationNoise | None = field(default=None, repr=False)
    simulation: SimulationResult | None = field(default=None, repr=False)
    known: KnownParameters = field(default_factory=KnownParameters)
    friction_warming: tuple[FrictionWarming, ...] = ()
    loop_values: dict[str, Any] | None = field(default=None, repr=False)
    judged: np.ndarray | None = field(default=None, repr=False)

    @classmethod
    def of(
        cls,
        problem: Any,
        theta: Mapping[str, float] | Sequence[float] | np.ndarray,
        covariance: np.ndarray | None = None,
        *,
        name: str = "own estimate",
        estimator: Callable[[np.ndarray, np.ndarray], Any] | None = None,
    ) -> Identification:
        """The result that parameters are, whoever found them.

        Errors joint by joint, covariances, equations for the tests and whatever else is judged are
        made from the problem at these parameters. A robust covariance is that of least squares on
        the same rows where none is given.

        Args:
            problem: the `Problem` whose parameters they are.
            theta: values by name, or in the order of ``problem.names``, shape (parameters,).
            covariance: theirs, shape (parameters, parameters), or None.
            name: name of the result.
            estimator: the function that estimates them again without a block of motion, see
                `pivident.identify`; None: held-out motion is judged with these values.

        Returns:
            The identification.

        Raises:
            IdentificationError: another shape, values that are not finite, a covariance that is
                none, or parameters that contradict what the problem fixes.
        """
        made = display.presentation.own_estimate(
            problem, theta, covariance, name=name, estimator=estimator
        )
        assert isinstance(made, cls)
        return made

    def __post_init__(self) -> None:
        settled = self.judged if self.judged is not None else np.array(self.theta)
        if not np.array_equal(settled, self.theta, equal_nan=True):
            raise UnusableValue(
                "theta was replaced, but errors, covariances and signals are those of the estimate "
                "before",
                advice="make a result of other parameters with Identification.of(problem, theta)",
            )
        object.__setattr__(self, "judged", settled)
        for kind in ("covariance", "robust_covariance", "formula_covariance"):
            object.__setattr__(self, kind, rounded_away(getattr(self, kind)))

    @property
    def iterations(self) -> int:
        """Number of iterations."""
        return len(self.history)

    @property
    def simulations(self) -> int:
        """How often the loop was simulated: once a pass, and once for each halving."""
        if self.method_used is None or not self.method_used.simulates_loop:
            return 0
        return sum(1 + made.halvings for made in self.history)

    @property
    def loop_in_words(self) -> str:
        """The loop that was simulated on one line, also of a loaded result; empty without one."""
        if self.loop is not None:
            return in_one_line(self.loop).strip("<>")
        return str((self.loop_values or {}).get("loop", ""))

    @property
    def is_decimated(self) -> bool:
        """Whether the method worked on low-passed and thinned rows rather than on all samples."""
        if self.equations is not None:
            return not self.equations.full_rate
        return self.method_used is not None and isinstance(self.method_used.signals, Decimated)

    @property
    def torque_scale(self) -> tuple[TorqueScale, ...]:
        """Unverified scales of the logged torques; all parameters rest on them."""
        return tuple(dict.fromkeys(s for r in self.recordings for s in r.torque_scale))

    @property
    def is_in_newton_metres(self) -> bool:
        """Whether the torque scale of some joint is known, or that of the description's masses."""
        unknown = {scale.joint for scale in self.torque_scale if scale.basis != MASSES}
        return len(unknown) < len(self.robot.joint_names)

    @property
    def scale_warnings(self) -> tuple[str, ...]:
        """What unverified scales mean for parameters, sentences for whatever is made of them."""
        return tuple(w.message for w in self.warnings if w.topic == "torque scale")

    @property
    def fitted_range(self) -> MotionRange | None:
        """Range of the fitted motion; None where neither signals nor their range are known."""
        return MotionRange.of(self.recordings) if self.recordings else self.motion

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter."""
        return tuple(p.unit for p in self.parameters)

    def cov_params(self) -> np.ndarray:
        """Covariance behind every interval that is shown, shape (parameters, parameters).

        The robust one, which holds for residuals of any colour and of changing variance; the
        method's own where it is not known. Its roots are ``std`` and ``bse``.
        """
        known = np.isfinite(np.diag(self.robust_covariance))
        return np.where(np.outer(known, known), self.robust_covariance, self.covariance)

    @property
    def nobs(self) -> int:
        """Number of equations that the estimate was made of: rows in use, all joints together."""
        return sum(fit.rows for fit in self.joints)

    @property
    def rsquared(self) -> float:
        """1 - ‖τ - Φθ‖²/‖τ‖², weighted as in the estimate, and not about the mean."""
        return 1.0 - self.relative_error**2

    @property
    def fittedvalues(self) -> np.ndarray:
        """Φθ of all recordings, one after the other, shape (samples, joints) [N m or N].

        NaN where a sample of a joint is no equation of the estimate.

        Raises:
            UnusableValue: the identification was loaded and holds no signals.
        """
        return self._in_use("tau_model")

    @property
    def resid(self) -> np.ndarray:
        """τ - Φθ, unfiltered, as ``fittedvalues``, shape (samples, joints) [N m or N]."""
        return self._in_use("tau") - self._in_use("tau_model")

    def _in_use(self, signal: str) -> np.ndarray:
        """A torque of all recordings, NaN where it was not used."""
        if not self.recordings:
            raise UnusableValue(
                "the identification holds no signals",
                advice="it was loaded from a file; predict(result, recording) computes torques",
            )
        parts = (np.where(r.used, getattr(r, signal), np.nan) for r in self.recordings)
        return np.concatenate(list(parts))

    @property
    def free_std(self) -> np.ndarray:
        """Standard errors, infinite where a value is fixed: what changes are compared with."""
        return np.where(self.restrictions.is_fixed, inf, self.std)

    @property
    def method_std(self) -> np.ndarray:
        """Standard errors by the method's covariance, shape (parameters,).

        With least squares and plain IV they hold for white residuals only.
        """
        return np.sqrt(np.diag(self.covariance))

    @property
    def robust_std(self) -> np.ndarray:
        """Standard errors by the sandwich, shape (parameters,)."""
        return np.sqrt(np.diag(self.robust_covariance))

    @property
    def formula_std(self) -> np.ndarray:
        """Standard errors by (P-31), for white residuals, shape (parameters,)."""
        return np.sqrt(np.diag(self.formula_covariance))

    @property
    def relative_std(self) -> np.ndarray:
        """100 σ/|θ| [%], shape (parameters,); infinite for an estimate of zero."""
        size = np.abs(self.theta)
        return np.divide(100.0 * self.std, size, out=np.full(size.shape, np.inf), where=size > 0)

    @property
    def bound_sides(self) -> tuple[str, ...]:
        """Bound that holds each estimate, ``low`` or ``high``; empty where none does."""
        if self.simulation is None:
            return self.restrictions.sides(self.theta)
        return tuple(self.simulation.side(name) for name in self.names)

    @cached_property
    def restrictions(self) -> Restrictions:
        """What was known beforehand, as restrictions of the parameters."""
        return self.known.restrictions(self.names)

    def value(self, name: str) -> float:
        """Estimate of one parameter, by its name with or without the trailing ``r``.

        Raises:
            UnknownName: names the nearest parameters that there are.
        """
        for k, (own, p) in enumerate(zip(self.names, self.parameters, strict=True)):
            if str(name).lower() in (own.lower(), p.name.lower()):
                return float(self.theta[k])
        raise UnknownName(f"no parameter {name!r}", advice=nearest(str(name), self.names))

    def predict(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Torque of the identified model, Φ(q, dq, ddq) θ, shape (samples, joints) [N m or N].

        Args:
            q: joint positions [rad or m], shape (samples, joints); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
        """
        return regressor_of(self.robot, self.parameters).torque(q, dq, ddq, self.theta)

    @cached_property
    def torque(self) -> InverseDynamics:
        """The same as a function prepared once: of one state, shape (joints,), or of samples."""
        return InverseDynamics(self.robot, self.parameters, self.theta)

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        headline = display.presentation.headline_of(self)
        return f"<Identification: {len(self.names)} parameters by {headline}>"

    def summary(self) -> Summary:
        """The result as text; ``as_html()`` and ``as_latex()`` give it for pages and papers."""
        return Summary(display.presentation.identification_text(self), self)

    def save(self, folder: Any) -> None:
        """Write ``identification.json`` and ``parameters.csv`` into a folder, all or nothing.

        Args:
            folder: folder to create or to write into.
        """
        display.presentation.save(self, folder)


def torque_sums(identification: Identification) -> TorqueSums:
    """Sums over the rows of an identification, all base parameters of its robot.

    Where the estimator worked on filtered rows, the torque is taken as Φθ of these rows plus the
    residual of the fit, so that the estimate has the error that it was reported with.
    """
    if not identification.recordings:
        raise UnusableValue(
            "the identification holds no signals",
            advice="its sums were made when it was saved (torque_sums), or identify again",
        )
    base = base_parameters(identification.robot)
    everything = regressor_of(identification.robot, base.parameters)
    theta = estimated_in_base(identification, base)
    weights = joint_weights(identification)
    size = len(base)
    gram, moment, square, rows = np.zeros((size, size)), np.zeros(size), 0.0, 0
    for recording in identification.recordings:
        inner = everything.inner(recording.q.T, recording.dq.T, recording.ddq.T, theta)
        for start in range(0, recording.t.size, BLOCK):
            part = slice(start, min(start + BLOCK, recording.t.size))
            used, residual = _used(recording, part)
            q, dq, ddq = (x[part].T for x in (recording.q, recording.dq, recording.ddq))
            packed = everything.packed(q, dq, ddq, inner=inner[:, part])
            for j in range(identification.robot.size):
                columns = everything.columns_of(j)
                phi = packed[everything.offsets[j] : everything.offsets[j + 1]] * used[j]
                tau = theta[columns] @ phi + residual[j]
                gram[np.ix_(columns, columns)] += weights[j] * (phi @ phi.T)
                moment[columns] += weights[j] * (phi @ tau)
                square += float(weights[j] * (tau @ tau))
                rows += int(np.count_nonzero(used[j]))
    return TorqueSums(gram, moment, square, rows)


def joint_weights(identification: Identification) -> np.ndarray:
    """1 / squared rms torque error of each joint, zero for one without equation, (joints,)."""
    return np.array(
        [1.0 / max(j.rms_error, 1e-150) ** 2 if j.rows else 0.0 for j in identification.joints]
    )


def estimated_in_base(identification: Identification, base: BaseParameters) -> np.ndarray:
    """The estimate among all base parameters, zero for those that it leaves out, shape (base,)."""
    theta = np.zeros(len(base))
    theta[estimated_indices(identification, base)] = identification.theta
    return theta


def estimated_indices(identification: Identification, base: BaseParameters) -> np.ndarray:
    """Which base parameters an estimate holds, shape (parameters,)."""
    place = {p.name: k for k, p in enumerate(base.parameters)}
    try:
        return np.array([place[p.name] for p in identification.parameters], dtype=np.int64)
    except KeyError as error:
        raise UnusableValue(
            f"{error.args[0]!r} is not a base parameter of robot {identification.robot.name!r}",
            advice="identify again with this robot",
        ) from None


def _used(recording: FittedRecording, part: slice) -> tuple[np.ndarray, np.ndarray]:
    """Ones where a row is used, and the residual there, both (joints, samples)."""
    used = recording.used[part].T.astype(float)
    return used, np.where(used > 0.0, (recording.tau[part] - recording.tau_model[part]).T, 0.0)
