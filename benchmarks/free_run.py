"""Horizon of an open loop: runs over the record against runs over moves, where the truth is known.

Records like the EMPS carriage's: the same moves, the same law of the controller, 25 s at 1 kHz, an
encoder of 50 nm. Friction has two slopes, a Coulomb level and an offset, and what no such law has,
as large as in the table of docs/emps_leaderboard.md: at each of the six constant speeds a force of
its own (0.35 N), the same in all periods, and a walk over time (0.19 N in a period). Mass, slopes,
level and offset of each machine are hidden.

`oloe` with both horizons is asked

* how far a free run of the same machine under pulses, another day's walk, is from its model, and
* how often its 95 % intervals hold the hidden constants.

    python -m benchmarks.free_run [records]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from benchmarks.emps_laws import TWO_SLOPES, Candidate
from benchmarks.open_loop_model import Stretch

from pivident.data.recording.recording import Recording
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import standard_parameters
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.friction import FrictionLaw
from pivident.robot.gallery import load_robot

#: The loop of the EMPS: rate [Hz], force for each volt [N/V], an encoder's count [m], pulses [V].
RATE, GAIN, COUNT, PULSE = 1000.0, 35.15, 5e-8, 5.07
CONTROLLER = Cascade([160.18], [243.45], averaged=True)

#: Speeds of the moves to and fro [m/s], how long they last [s], and what leads there [m/s²].
SPEEDS, LASTING, ACCELERATION = (0.042, 0.083, 0.125, 0.042), (0.4, 0.785, 1.185, 0.4), 0.84

#: Periods of a record, and samples of one.
PERIODS, PERIOD = 4, 6240

#: Constants of the carriage, and half the range they are drawn from [kg, N s/m, N s/m, N, N].
MIDDLE = {"m1": 95.0, "fvp1": 160.0, "fvn1": 235.0, "fc1": 21.0, "off1": -0.2}
RANGE = {"m1": 5.0, "fvp1": 30.0, "fvn1": 30.0, "fc1": 3.0, "off1": 2.0}

#: Standard deviations of friction that is not in the law: of what lasts, and of its walk in a
#: period [N].
LASTS, WALKS = 0.35, 0.19

LAW = Candidate("two slopes", TWO_SLOPES)
ROBOT = load_robot("emps").with_friction(FrictionLaw(TWO_SLOPES))


@dataclass(frozen=True, eq=False)
class Machine:
    """A carriage with hidden friction.

    Attributes:
        constants: of its law, by name.
        lasting: what its friction has beside the law at each speed and direction [N], (2, 3).
    """

    constants: dict[str, float]
    lasting: np.ndarray

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Machine:
        """One of many."""
        constants = {k: MIDDLE[k] + RANGE[k] * rng.uniform(-1.0, 1.0) for k in MIDDLE}
        return cls(constants, LASTS * rng.standard_normal((2, 3)))

    def record(self, rng: np.random.Generator, pulses: float = 0.0) -> Recording:
        """What its loop gives with a walk of its own; ``pulses``: beside the drive input [V]."""
        q_ref = reference()
        samples = len(q_ref)
        lacking = self._beside_the_law(rng, np.gradient(q_ref[:, 0]) * RATE)
        push = pulses * ((np.arange(samples) + 157) // 500 % 2)
        parameters = standard_parameters(ROBOT)
        values = np.array([self.constants.get(p.name, 0.0) for p in parameters])
        signals = LoopSignals(
            RATE, q_ref, None, (push - lacking / GAIN)[:, None], None, np.array([GAIN]),
            np.array([10.0]), np.array([0.1]), np.array([10.0]), count=np.array([COUNT]),
        )  # fmt: skip
        model = make_model(ROBOT, parameters, values)
        made = simulate(model, CONTROLLER, signals, ROBOT.joint_names)
        return Recording(
            name="simulated", joint_names=ROBOT.joint_names, rate=RATE,
            q=COUNT * np.round(made.q / COUNT), q_ref=q_ref, tau=made.tau + lacking[:, None],
            torque_timing="held",
        )  # fmt: skip

    def _beside_the_law(self, rng: np.random.Generator, speed: np.ndarray) -> np.ndarray:
        """Friction that the law lacks [N], linear between the speeds, none at rest."""
        force, knots = np.zeros(len(speed)), np.array([0.0, *SPEEDS[:3]])
        for sign, own in zip((1.0, -1.0), self.lasting, strict=True):
            walk = np.cumsum(rng.standard_normal((len(speed), 3)), axis=0) * WALKS / PERIOD**0.5
            shares = [np.interp(sign * speed, knots, hat) for hat in np.eye(4)[1:]]
            force += np.sum((own + walk - walk.mean(axis=0)).T * shares, axis=0)
        return force


def reference() -> np.ndarray:
    """To and fro from rest to rest at three speeds, four times, shape (samples, 1) [m]."""
    speeds = []
    for sign in (1.0, -1.0):
        for speed, lasting in zip(SPEEDS, LASTING, strict=True):
            ramp = speed / ACCELERATION
            t = np.arange(round((lasting + ramp) * RATE)) / RATE
            shape = np.clip(np.minimum(t, lasting + ramp - t) / ramp, 0.0, 1.0)
            speeds.append(sign * speed * shape)
    return np.cumsum(np.tile(np.concatenate(speeds), PERIODS))[:, None] / RATE


@dataclass(frozen=True)
class Outcome:
    """What an estimate is worth.

    Attributes:
        error: of a free run under pulses [mm].
        z: errors of the constants in standard errors, in the order of ``MIDDLE``.
        converged: whether the search settled.
        seconds: processor time of the estimate.
    """

    error: float
    z: tuple[float, ...]
    converged: bool
    seconds: float


def judged(seed: int) -> dict[str, Outcome]:
    """Both horizons on one machine."""
    rng = np.random.default_rng(seed)
    machine = Machine.drawn(rng)
    train, test = machine.record(rng), machine.record(rng, PULSE)
    outcomes = {}
    for horizon in ("moves", "record"):
        begin = process_time()
        found = identify(Problem(ROBOT, (train,)), replace(METHODS["oloe"], horizon=horizon))
        seconds = process_time() - begin
        values = dict(zip(MIDDLE, found.theta.tolist(), strict=True))
        model = replace(LAW.model(values), drive_gain=GAIN)
        z = (found.theta - np.array(list(machine.constants.values()))) / found.std
        error = model.score(test, Stretch(0, len(test.q)))
        outcomes[horizon] = Outcome(error, tuple(z.tolist()), found.converged, seconds)
    return outcomes


def main() -> None:
    """All machines, then error and coverage of both horizons."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    made: dict[str, list[Outcome]] = {"moves": [], "record": []}
    for seed in range(count):
        for horizon, own in judged(seed).items():
            made[horizon].append(own)
            z = " ".join(f"{value:6.2f}" for value in own.z)
            print(
                f"{seed:3} {horizon:7} {own.error:6.2f} mm   z {z}   {own.seconds:.2f} s",
                flush=True,
            )
    errors = {h: np.sqrt(np.mean([o.error**2 for o in own])) for h, own in made.items()}
    for horizon, own in made.items():
        covered = np.mean(np.abs([o.z for o in own]) < 1.96)
        settled = np.mean([o.converged for o in own])
        print(
            f"{horizon:7} free run {errors[horizon]:.2f} mm, coverage {covered:.1%}, "
            f"converged {settled:.0%}, {np.median([o.seconds for o in own]):.2f} s"
        )
    print(f"record over moves: {errors['record'] / errors['moves']:.2f}")


if __name__ == "__main__":
    main()
