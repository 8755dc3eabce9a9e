"""The simulated test bench of a scenario: true robot, loop, motion, noise, and perturbed starts.

A run is identified by its number. Its noise depends only on (run, scenario seed), so any worker
simulates the same record.

Starts of the iteration: robots with perturbed but physically possible parameters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.parameters import Parameter, nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.problem import Problem
from pivident.foundation.errors import ExperimentError
from pivident.foundation.options import per_joint
from pivident.linear.free_law import FreeLaw, identify_free_law
from pivident.loop.simulation.closed_loop import Trajectory
from pivident.loop.simulation.control_loop import Loop, with_measured_gravity
from pivident.loop.simulation.controllers import Controller
from pivident.loop.simulation.excitation import FourierSeries
from pivident.loop.simulation.simulated_record import Noise, Spread, loop_motion, stream
from pivident.models.runnable_model import is_possible
from pivident.robot.naming import nearest
from pivident.studies.many.study.scenario_tables import ScenarioTables, reference_of

#: Random stream of the starts, beside those of the noise.
STARTS = 3
#: Maximum number of draws of a physically possible link.
DRAWS = 1000


def perturbed_values(base: BaseParameters, spread: float, rng: np.random.Generator) -> np.ndarray:
    """Base parameters of a robot with perturbed standard parameters, shape (base,).

    Each is multiplied by 1 + spread · N(0, 1). Links that are physical in the description are
    drawn again until they are.
    """
    nominal = nominal_values(base.robot, base.standard)
    drawn = nominal.copy()
    links: dict[tuple[int, bool], list[int]] = {}
    for k, p in enumerate(base.standard):
        links.setdefault((p.joint, p.is_inertial), []).append(k)
    for (_, inertial), own in links.items():
        wanted = inertial and is_possible(nominal[own])
        for _ in range(DRAWS):
            drawn[own] = nominal[own] * (1.0 + spread * rng.standard_normal(len(own)))
            if not wanted or is_possible(drawn[own]):
                break
        else:
            drawn[own] = nominal[own]
    return base.values(drawn)


@dataclass(frozen=True, eq=False)
class Bench:
    """Everything of a scenario that its runs share.

    Attributes:
        scenario: the scenario, or one condition of it.
        series: optimised Fourier motion of the scenario, where it asks for one.
    """

    scenario: ScenarioTables  # the scenario, or one condition of it
    # optimised Fourier motion of the scenario, if it has one
    series: FourierSeries | None = None

    @cached_property
    def base(self) -> BaseParameters:
        """Base parameters of the robot."""
        return base_parameters(self.scenario.robot)

    @cached_property
    def heads(self) -> tuple[Parameter, ...]:
        """Heads of the groups with non-zero true values."""
        return tuple(self.base.parameters[k] for k in self._selected)

    @cached_property
    def true_values(self) -> np.ndarray:
        """Their values, shape (parameters,)."""
        values = self.base.values(nominal_values(self.scenario.robot, self.base.standard))
        for name, value in self.scenario.content.truth.values.items():
            values[self._index(name)] = value
        return values[self._selected]

    @property
    def truth(self) -> dict[str, float]:
        """True values by the name of the group's head."""
        return {p.name: float(v) for p, v in zip(self.heads, self.true_values, strict=True)}

    @cached_property
    def estimated(self) -> tuple[str, ...]:
        """Names of the estimated base parameters, as in results."""
        names = self.scenario.content.identify.parameters
        chosen = self._selected if names is None else sorted(self._index(n) for n in names)
        return tuple(self.base.names[k] for k in chosen)

    @cached_property
    def expected(self) -> np.ndarray:
        """True values of the estimated parameters, zero if not among the true ones."""
        known = {self.base.index(name): value for name, value in self.truth.items()}
        return np.array([known.get(self.base.index(name), 0.0) for name in self.estimated])

    @cached_property
    def regressor(self) -> Regressor:
        """Observation matrix of the estimated parameters."""
        heads = [self.base.parameters[self.base.index(name)] for name in self.estimated]
        return regressor_of(self.scenario.robot, heads)

    @cached_property
    def controller(self) -> Controller:
        """The control law as the estimators know it."""
        from pivident.experiment.recording_tables import control_law

        return control_law(self.scenario.content.controller, self.scenario.robot.size)

    @cached_property
    def loop(self) -> Loop:
        """The loop as the estimators know it."""
        entry, n = self.scenario.content.controller, self.scenario.robot.size
        return Loop(
            self.controller,
            per_joint("controller.drive_gain", entry.drive_gain, n),
            np.full(n, np.inf)
            if entry.limit is None
            else per_joint("controller.limit", entry.limit, n),
            feed_forward=entry.feed_forward,
            count=np.array(self.noise.count) if self.noise.rounding == "loop" else 0.0,
        )

    @cached_property
    def noise(self) -> Noise:
        """Noise of all runs."""
        from pivident.experiment.recording_tables import size_of_count

        entry, n = self.scenario.content.noise, self.scenario.robot.size
        coloured: dict[str, Any] = {}
        if entry.coloured is not None:
            coloured = {
                "coloured": _noise_std("noise.coloured.std", entry.coloured.std, n),
                "frequency": entry.coloured.frequency,
                "radius": entry.coloured.radius,
            }
        rate = self.scenario.content.record.law_rate
        coloured.setdefault("frequency", rate / 4.0)  # without effect if there is no such noise
        return Noise(
            encoder=_noise_std("noise.encoder", entry.encoder, n),
            torque=_noise_std("noise.torque", entry.torque, n),
            count=tuple(size_of_count("counts", entry.counts, self.scenario.robot).tolist()),
            rate=rate,
            where=entry.where,
            rounding=entry.rounding,
            **coloured,
        )

    @cached_property
    def reference(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reference q, dq, ddq of the first motion at the control rate, each (samples, joints)."""
        return self.reference_of_record(0)

    def reference_of_record(self, record: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reference of a record: the seeds of the trajectory take turns."""
        return reference_of(self.scenario, self.scenario.content.trajectory, self.series, record)

    @cached_property
    def second_reference(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reference of the motion that is not used for identification."""
        entry = self.scenario.content.validation
        if entry is None:
            first = self.scenario.content.trajectory
            changes: dict[str, Any] = {"seed": max(first.seeds) + 1}
            if first.type == "fourier":
                changes["optimise"] = False
            entry = first.model_copy(update=changes)
        return reference_of(self.scenario, entry)

    @cached_property
    def noise_free(self) -> Trajectory:
        """The true motion without any noise, at the control rate."""
        return self.simulated(self.heads, self.true_values, self.reference)

    @cached_property
    def second_motion(self) -> Trajectory:
        """The true motion along the second reference, without noise."""
        return self.simulated(self.heads, self.true_values, self.second_reference)

    def record_of(self, run: int) -> int:
        """Number of the record that a run uses; runs of different starts may share one."""
        return run % self._records

    def start_of(self, run: int) -> int:
        """Number of the start of a run: every pair of start and record occurs once."""
        count = self.scenario.content.start.count
        return (run + run // math.lcm(count, self._records)) % count

    def problem(self, run: int) -> Problem:
        """The identification problem of a run."""
        content = self.scenario.content
        parameters = content.identify.parameters or [p.name for p in self.heads]
        recording = self.recording(self.record_of(run))
        return Problem(
            self.scenario.robot,
            (recording,),
            self.loop
            if content.law == "known"
            else replace(self.loop, controller=self.identified_law(recording).law),
            tuple(parameters),
            mask=content.identify.mask,
            initial=self.start(self.start_of(run)),
        )

    def identified_law(self, recording: Recording) -> FreeLaw:
        """A law of unknown structure, identified from a record.

        Args:
            recording: a record of the bench.
        """
        loop = self.loop
        return identify_free_law(
            recording, loop.drive_gain, loop.limit, method="srivc", reference_inputs=True
        )

    def recording(self, record: int) -> Recording:
        """A simulated record."""
        entry, noise = self.scenario.content.record, self.noise
        seed = (record, self.scenario.content.seed)
        reference = self.reference_of_record(record)
        q_ref, dq_ref, ddq_ref = reference
        added = noise.in_loop(seed, q_ref.shape)
        made = self.simulated(
            self.heads,
            self.true_values,
            reference,
            added if noise.where == "loop" else None,
            rounded=noise.rounding == "loop",
        )
        q, tau = (made.q + added)[:: entry.step], made.tau[:: entry.step]
        return Recording(
            f"{self.scenario.title}-{record}",
            self.scenario.robot.joint_names,
            noise.quantised(q),
            tau + noise.of_torque(seed, tau.shape),
            entry.rate,
            q_ref=q_ref[:: entry.step],
            dq_ref=dq_ref[:: entry.step],
            ddq_ref=ddq_ref[:: entry.step],
            control_rate=entry.law_rate,
            torque_timing=entry.torque_timing,
            saturation="refuse" if np.isinf(self.loop.limit).all() else "allow",
        )

    def simulated(
        self,
        parameters: tuple[Parameter, ...],
        theta: np.ndarray,
        reference: tuple[np.ndarray, np.ndarray, np.ndarray],
        noise: np.ndarray | None = None,
        clip: bool = False,
        rounded: bool = False,
    ) -> Trajectory:
        """The closed loop along a reference q, dq, ddq, at the control rate.

        Args:
            parameters: heads of base groups; the others are zero.
            theta: their values, shape (parameters,).
            reference: q, dq, ddq, each of shape (joints, samples).
            noise: position noise that the control law reads [rad or m].
            clip: whether negative friction levels count as zero.
            rounded: whether the control law reads rounded positions.

        Returns:
            Positions, speeds, accelerations and torques of the simulated loop.

        Raises:
            SimulationDiverged: names the joint and the time.
        """
        scenario, loop, rate = self.scenario, self.loop, self.scenario.content.record.law_rate
        controller = with_measured_gravity(
            self.controller, scenario.robot, loop.drive_gain, loop.feed_forward
        )
        return loop_motion(
            scenario.robot,
            loop,
            rate,
            reference,
            parameters,
            theta,
            controller=controller,
            noise=noise,
            count=loop.counts(scenario.robot.size) if rounded else None,
            clip=clip,
        )

    def start(self, number: int) -> dict[str, float]:
        """Initial values of the iteration by parameter name.

        True values times ``start.inertia`` or ``start.friction``; with a spread, those of a robot
        whose standard parameters deviate by so much, normally distributed, and are physical.

        Args:
            number: of the start.
        """
        entry = self.scenario.content.start
        values = self._perturbed(number, entry.spread) if entry.spread else self.true_values
        return {
            p.name: float(value * (entry.friction if p.friction or p.coupling else entry.inertia))
            for p, value in zip(self.heads, values, strict=True)
        }

    def _perturbed(self, number: int, spread: float) -> np.ndarray:
        """Values of the true parameters on a perturbed robot."""
        rng = stream((number, self.scenario.content.seed), STARTS)
        values = perturbed_values(self.base, spread, rng)
        for name, value in self.scenario.content.truth.values.items():
            values[self._index(name)] = value * (1.0 + spread * rng.standard_normal())
        return values[self._selected]

    @cached_property
    def _selected(self) -> list[int]:
        """Indices of the base parameters with non-zero true values."""
        names = self.scenario.content.truth.parameters
        chosen = range(len(self.base)) if names is None else [self._index(n) for n in names]
        return sorted({*chosen, *map(self._index, self.scenario.content.truth.values)})

    @property
    def _records(self) -> int:
        """Number of different records; as many as runs unless the scenario says otherwise."""
        return self.scenario.content.record.records or 2**40

    def _index(self, name: str) -> int:
        try:
            return self.base.index(name)
        except KeyError:
            known = [p.name for p in self.base.parameters]
            raise ExperimentError(
                f"robot {self.scenario.robot.name!r} has no base parameter {name!r}",
                advice=nearest(name.removesuffix("r"), known),
            ) from None


def _noise_std(key: str, value: Any, joints: int) -> Spread:
    """One number for all joints, or a tuple."""
    if np.ndim(value) == 0:
        return float(value)
    return tuple(per_joint(key, value, joints).tolist())
