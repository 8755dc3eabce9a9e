"""What methods may cope with, each as a small task that a method either does or is not asked to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

import pivident as pv
from pivident.data import with_wrenches
from pivident.data.recording.recording import Recording
from pivident.estimation.method import Method
from pivident.loop import virtual_pd
from pivident.loop.simulation.simulated_record import SimulatedRecord
from pivident.robot import (
    FrictionLaw,
    WrenchSensor,
    coulomb,
    dahl,
    load_dependent,
    offset,
    viscous,
    with_wrench_sensors,
)
from pivident.studies import identify_payload
from pivident.studies.friction_laws.law_candidates import adding
from pivident.studies.friction_laws.law_choice import choose_laws
from pivident.studies.friction_laws.shapes import identify_shapes

RATE, PERIOD, PERIODS = 1000.0, 1000, 4

LOOP = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]))

ARM = pv.load_robot("planar_2r")


def reference(size: int, reach: float = 0.7) -> np.ndarray:
    """Four periods of one second, so that every method finds what it needs, (samples, size)."""
    t = np.arange(PERIODS * PERIOD) / RATE
    waves = [np.sin(2 * np.pi * (j + 1) * t) + 0.4 * np.cos(6 * np.pi * t + j) for j in range(size)]
    return reach * np.column_stack(waves)


@cache
def simulated() -> SimulatedRecord:
    """The planar arm in its loop, with its true values."""
    return pv.simulate(ARM, LOOP, reference(2), rate=RATE, encoder=2e-6, torque=0.05, seed=1)


def recording() -> Recording:
    """What was logged of it."""
    return simulated().recording


def problem(**changes: object) -> pv.Problem:
    """The problem of the planar arm, or one that differs from it."""
    return replace(pv.Problem(ARM, (recording(),), LOOP), **changes)


def run(task: pv.Problem, method: Method) -> np.ndarray:
    """Estimates of a problem."""
    return pv.identify(task, method, test_gains=False).theta


@cache
def five_bar() -> pv.Problem:
    """A mechanism with a closed loop."""
    robot = pv.load_robot("five_bar")
    rest = robot.constraints.posture[list(robot.places)]
    rise = np.minimum(np.arange(PERIODS * PERIOD) / (0.8 * PERIOD), 1.0)[:, None]
    loop = pv.Loop(virtual_pd(robot, rest))
    q_ref = rest + rise * reference(2, 0.25)
    made = pv.simulate(robot, loop, q_ref, rate=RATE, encoder=2e-6, torque=0.2, seed=5)
    return pv.Problem(robot, (made.recording,), loop)


@cache
def on_a_sensor() -> pv.Problem:
    """The planar arm on a force sensor that shows noise."""
    robot = with_wrench_sensors(ARM, [WrenchSensor("floor", "base")])
    wrench = np.random.default_rng(1).normal(size=(recording().samples, 6))
    return pv.Problem(robot, (with_wrenches(recording(), robot, {"floor": wrench}),), LOOP)


def with_laws(**laws: FrictionLaw) -> pv.Problem:
    """The problem with other friction laws."""
    return problem(robot=ARM.with_friction(laws))


def without_torque() -> pv.Problem:
    """A log of positions and references alone."""
    silent = np.zeros_like(recording().tau)
    return problem(recordings=(replace(recording(), tau=silent, torque_source="none"),))


def without_reference() -> pv.Problem:
    """A virtual loop around the measured motion."""
    loop = pv.Loop(virtual_pd(ARM, recording().q.mean(axis=0)), reference="smoothed")
    return problem(loop=loop)


def one_equation() -> pv.Problem:
    """A shoulder that moves and whose torque does not count; what belongs to it alone is known."""
    truth = simulated().truth
    own = {name: truth[name] for name in problem().names[:6]}
    return problem(without_equation="shoulder", fixed=own)


def choose(method: Method) -> np.ndarray:
    """One change of one joint's friction law is judged."""
    change = {"offset": adding((offset(),))}
    choice = choose_laws(problem(), method, changes=change, joints=["elbow"], depth=1, folds=4)
    return np.array([score.rms for score in choice.joint("elbow").scores])


def shapes(method: Method) -> np.ndarray:
    """The distance of a law with presliding is searched."""
    law = FrictionLaw((viscous(), dahl(0.01)))
    found = identify_shapes(
        with_laws(elbow=law), method, {"elbow": ["presliding_distance"]}, grid=False, profiles=False
    )
    return found.identification.theta


@cache
def loaded() -> Recording:
    """The arm with a heavier end."""
    links = (*ARM.links[:-1], replace(ARM.links[-1], inertia=_heavier(ARM.links[-1].inertia)))
    heavy = replace(ARM, links=links)
    made = pv.simulate(heavy, LOOP, reference(2), rate=RATE, encoder=2e-6, torque=0.05, seed=2)
    return made.recording


def _heavier(inertia: tuple[float, ...]) -> tuple[float, ...]:
    """Ten parameters of a link with two kilograms at its end."""
    values = list(inertia)
    values[-1] += 2.0
    return tuple(values)


@dataclass(frozen=True)
class Feature:
    """Something that a method may cope with.

    Attributes:
        title: what it is, for the page.
        task: gives numbers that are finite where the method does it.
        handled: whether a method does.
    """

    title: str
    task: Callable[[Method], np.ndarray]
    handled: Callable[[Method], bool]


def _known(title: str, **given: object) -> Feature:
    """Something that is known of the parameters beforehand."""
    return Feature(
        title,
        lambda m: run(problem(**given), m),
        lambda m: set(given) <= set(m.handles.known),
    )


FEATURES = {
    "trees": Feature("open chains and trees", lambda m: run(problem(), m), lambda m: True),
    "closed_loops": Feature(
        "closed loops of bodies", lambda m: run(five_bar(), m), lambda m: m.handles.closed_loops
    ),
    "wrenches": Feature(
        "measured wrenches, measured bases",
        lambda m: run(on_a_sensor(), m),
        lambda m: m.handles.wrenches,
    ),
    "inner_friction": Feature(
        "friction with a memory or of the load",
        lambda m: run(
            with_laws(
                shoulder=FrictionLaw((viscous(), coulomb(), load_dependent())),
                elbow=FrictionLaw((viscous(), dahl(0.01))),
            ),
            m,
        ),
        lambda m: m.handles.inner_friction,
    ),
    "computed_torque": Feature(
        "logs without torque",
        lambda m: run(without_torque(), m),
        lambda m: m.handles.computed_torque,
    ),
    "no_controller": Feature(
        "an unknown controller",
        lambda m: run(problem(loop=None), m),
        lambda m: m.handles.no_controller,
    ),
    "no_reference": Feature(
        "an unknown reference",
        lambda m: run(without_reference(), m),
        lambda m: m.handles.no_reference,
    ),
    "law_choice": Feature("choice of friction laws", choose, lambda m: m.handles.law_choice),
    "shape_constants": Feature(
        "constants of friction laws", shapes, lambda m: m.handles.shape_constants
    ),
    "payload": Feature(
        "payloads",
        lambda m: identify_payload(problem(), [loaded()], m).load.values,
        lambda m: m.handles.payload,
    ),
    "fixed": _known("known values", fixed={"fv1": 2.0}),
    "bounds": _known("bounds", bounds={"fv1": (0.0, None)}),
    "priors": _known("priors", priors={"fv1": (2.0, 1.0)}),
    "constraints": _known("linear equations", constraints=[({"fv1": 1.0, "fv2": -1.0}, 0.0)]),
    "weights": Feature(
        "weights of samples",
        lambda m: run(problem(weights={"elbow": 0.5}), m),
        lambda m: m.handles.weights,
    ),
    "without_equation": Feature(
        "joints without an equation",
        lambda m: run(one_equation(), m),
        lambda m: m.handles.without_equation,
    ),
}
