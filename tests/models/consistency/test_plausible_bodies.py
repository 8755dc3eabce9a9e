"""Bodies where torques say nothing: near the description or the geometry, printed as bodies."""

from dataclasses import replace
from decimal import Decimal
from functools import cache
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.models.consistency.cone_program import solve_cone_program
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.consistency.constraints import Bounds, make_constraints, plausible_bodies
from pivident.models.consistency.link_quantities import link_table, moments_text
from pivident.models.consistency.metric import make_metric
from pivident.models.consistency.nearest_consistent import (
    imposed,
    nearest_consistent,
    standard_space,
)
from pivident.models.consistency.pseudo_inertia import LinkBody, link_body
from pivident.models.consistency.reference import geometric_bodies, link_spheres, make_reference
from pivident.models.export.mjcf import to_mjcf
from pivident.models.export.urdf import to_urdf
from pivident.models.runnable_model import runnable_model
from pivident.robot.gallery import load_robot
from pivident.robot.inertia import tensor
from tests.synthetic_identification import synthetic_identification


def bare(free):
    """The same estimate with a robot from a file without inertials and rotors."""
    robot = free.robot
    links = tuple(replace(link, inertia=np.zeros(10)) for link in robot.links)
    robot = replace(robot, links=links, rotor_inertia=np.zeros(robot.size))
    return replace(free, robot=robot, recordings=())


@cache
def noisy():
    """An estimate of the TX40 so poor in the wrist that it is not consistent."""
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=0.15, seed=2)
    return replace(free, recordings=())


def masses(model):
    return np.array([body.mass for body in model.links])


def test_masses_stay_near_the_description():
    model = make_consistent(noisy())
    nominal = np.array([link.inertia[9] for link in noisy().robot.links])
    assert not model.was_consistent
    most = np.maximum(3.0 * nominal, nominal + 0.1 * nominal.sum())
    assert (masses(model) < most * (1 + 1e-5)).all()
    assert (masses(model) > nominal / 3.0 * (1 - 1e-5)).all()
    assert 1 / 1.15 < masses(model).sum() / nominal.sum() * (1 + 1e-6) < 1.15 * (1 + 2e-6)


def test_bodies_fit_their_links():
    """The mass of a link is within reach of its joints, or of what its description says."""
    model = make_consistent(noisy())
    for (middle, radius), body, link in zip(
        link_spheres(noisy().robot), model.links, noisy().robot.links, strict=True
    ):
        own = link_body("described", link.inertia)
        far = {}
        for name, some in (("here", body), ("described", own)):
            offset = some.center_of_mass - middle
            far[name] = np.sqrt(np.trace(some.inertia) / 2.0 / some.mass + offset @ offset)
        assert far["here"] <= max(radius, 1.5 * far["described"]) * (1 + 1e-4)
    assert radius < 0.2 and link_spheres(noisy().robot)[1][1] < 0.3


def test_an_inertia_without_a_mass_becomes_a_body_of_its_link():
    """As models of the first link that turns about one axis have it."""
    first, *others = noisy().robot.links
    inertia = np.r_[first.inertia[:6], np.zeros(4)]
    robot = replace(noisy().robot, links=(replace(first, inertia=inertia), *others))
    body = make_consistent(replace(noisy(), robot=robot)).links[0]
    assert body.mass > 0.1
    assert np.sqrt(np.linalg.eigvalsh(body.inertia)[-1] / body.mass) < 0.3


def test_a_total_mass_is_asked_for_where_its_limit_decides():
    """A description with 70 % of the masses, which this noisy estimate does not contradict."""
    light = tuple(replace(link, inertia=0.7 * link.inertia) for link in noisy().robot.links)
    free = replace(noisy(), robot=replace(noisy().robot, links=light))
    described = sum(link.inertia[9] for link in light)
    model = make_consistent(free)
    (asked,) = [note for note in model.notes if "total_mass = [lowest, highest]" in note]
    assert masses(model).sum() / described == pytest.approx(1.15, rel=1e-4)
    assert f"{described:.4g} kg" in asked
    known = make_consistent(free, bounds=Bounds(total_mass=(1.3 * described, 1.35 * described)))
    assert 1.3 <= masses(known).sum() / described * (1 + 1e-5)
    assert not any("total_mass = [lowest" in note for note in known.notes)


def test_an_arm_without_described_bodies_weighs_what_an_arm_weighs():
    """The TX40's CAD masses, 21 kg, from its geometry and the estimated first moments."""
    nominal = np.array([link.inertia[9] for link in noisy().robot.links])
    model = make_consistent(bare(noisy()))
    assert masses(model).max() < 2.0 * nominal.max()
    assert 0.4 < masses(model).sum() / nominal.sum() < 2.5


def test_what_the_data_determine_keeps_its_value():
    """The nearest point by a program without prior; then moves by a tenth of σ at most."""
    free = noisy()
    model = make_consistent(free)
    base = base_parameters(free.robot)
    reference = make_reference(free.robot, base.standard, 0.01)
    metric = make_metric(free, base, None, reference.scales[base.kept])
    space = standard_space(free.robot, metric, reference)
    conditions = imposed(space, make_constraints(free.robot, base.standard, reference))
    weights = np.where(np.arange(space.slope.shape[1]) < space.distances, 1.0, 1e-8)
    nearest = solve_cone_program(weights, np.zeros(weights.size), conditions)
    at = base.values(space.values(nearest.u))
    relative = free.std / np.maximum(np.abs(free.theta), free.std)
    moved = np.abs(model.theta - at) / free.std
    assert (moved <= np.clip(relative, 0.1, 1.0) + 1e-3).all()
    assert moved.max() > 0.05


def test_masses_that_the_data_contradict_are_kept_and_said():
    """A forearm of five times the mass that the description has, precisely estimated."""
    free = replace(synthetic_identification(relative_std=1e-4), recordings=())
    light = tuple(replace(link, inertia=link.inertia / 5.0) for link in free.robot.links)
    model = make_consistent(replace(free, robot=replace(free.robot, links=light)))
    heavier = masses(model) / np.array([link.inertia[9] for link in light])
    assert heavier.max() > 3.0
    assert any("contradict plausible bodies" in note for note in model.notes)


def test_masses_that_no_torque_contradicts_are_plausible_however_small_the_standard_errors():
    """An arm described with two fifths of its masses, where the torque error does not tell."""
    free = noisy()
    light = tuple(replace(link, inertia=0.4 * link.inertia) for link in free.robot.links)
    robot = replace(free.robot, links=light)
    base = base_parameters(robot)
    near = make_reference(robot, base.standard, 0.01)
    space = standard_space(robot, make_metric(free, base, None, near.scales[base.kept]), near)
    conditions = make_constraints(robot, base.standard, near)
    plausible = plausible_bodies(robot, base.standard, near)
    described = sum(link.inertia[9] for link in light)

    def found(error):
        one = nearest_consistent(space, conditions, near, "entropic", plausible, torque_error=error)
        return one.values[space.links[:, 9]].sum() / described, one.notes

    total, notes = found(lambda values: np.nan)
    assert total > 2.0 and "contradict plausible bodies by" in notes[0]
    total, notes = found(lambda values: 1.0)
    assert total == pytest.approx(1.15, rel=1e-4) and not notes


def test_declared_masses_replace_plausible_ones():
    free = noisy()
    heavy = 4.0 * free.robot.links[3].inertia[9]
    name = free.robot.links[3].name
    model = make_consistent(free, bounds=Bounds(mass={name: (heavy, None)}), accept_far=True)
    assert model.link(name).mass >= heavy * (1 - 1e-5)
    assert not any(f"{name}: mass at most" in note for note in model.notes)


def test_geometric_bodies_are_cylinders():
    """Mass, centre and moments of a solid cylinder by summing over points of a fine grid."""
    robot = load_robot("planar_2r")
    first = geometric_bodies(robot)[0]
    end = np.linalg.norm(robot.joints[1].translation)
    volume = first[3, 3]
    assert first[:3, 3] / volume == pytest.approx(robot.joints[1].translation / 2.0)
    assert np.linalg.eigvalsh(first)[0] > 0.0
    # π r² (l + 2 r) = volume
    radius = np.roots([2 * np.pi, np.pi * end, 0.0, -volume])
    radius = float(radius[np.isreal(radius) & (radius.real > 0)].real[0])
    axis = robot.joints[1].translation / end
    u = np.linspace(-1, 1, 81)
    x, y, z = np.meshgrid(radius * u, radius * u, (end / 2 + radius) * u, indexing="ij")
    inside = x**2 + y**2 <= radius**2
    along = volume * np.mean(z[inside] ** 2)
    center = first[:3, 3] / volume
    central = first[:3, :3] - volume * np.outer(center, center)
    assert axis @ central @ axis == pytest.approx(along, rel=0.05)
    assert np.trace(central) - axis @ central @ axis == pytest.approx(
        volume * np.mean((x**2 + y**2)[inside]), rel=0.05
    )


@pytest.mark.parametrize("seed", range(5))
def test_printed_moments_are_those_of_a_body(seed):
    """Rods, plates and blocks; the printed numbers are read back exactly."""
    rng = np.random.default_rng(seed)
    bodies = []
    for _ in range(100):
        second = 10.0 ** rng.uniform(-9, 0, 3)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        inertia = turn @ np.diag(second.sum() - second) @ turn.T
        bodies.append(LinkBody("link", 1.0, np.zeros(3), inertia))
    rows = link_table(bodies).text().splitlines()[-len(bodies) :]
    for body, row in zip(bodies, rows, strict=True):
        a, b, c = sorted(Decimal(text) for text in row.split()[-3:])
        assert a > 0
        assert c <= a + b
        assert [float(a), float(b), float(c)] == pytest.approx(body.principal_moments, rel=6e-3)


def test_digits_are_added_only_where_they_are_needed():
    assert moments_text(np.array([0.0123456, 0.0234567, 0.0301234])) == [
        "0.0123",
        "0.0235",
        "0.0301",
    ]
    rod = moments_text(np.array([0.1234, 1.004, 1.127]))
    assert rod == ["0.1234", "1.004", "1.127"]
    assert all(float(low) <= float(high) for low, high in pairwise(rod))


@pytest.mark.parametrize("given", ["described", "geometric"])
def test_written_inertias_are_those_of_bodies(given):
    """URDF and MJCF parsed back: positive, and no moment larger than the sum of the others."""
    model = runnable_model(make_consistent(noisy() if given == "described" else bare(noisy())))
    count = model.robot.size
    urdf, tensors = ElementTree.fromstring(to_urdf(model).text), []
    for element in urdf.iter("inertia"):
        tensors.append(tensor([float(element.get(f"i{e}")) for e in "xx xy xz yy yz zz".split()]))
    mjcf = ElementTree.fromstring(to_mjcf(model).text)
    written = [e.get("diaginertia") for e in mjcf.iter("inertial") if e.get("diaginertia")]
    diagonal = [np.array(text.split(), dtype=float) for text in written]
    assert len(tensors) == len(diagonal) == count
    for moments in (*map(np.linalg.eigvalsh, tensors), *map(np.sort, diagonal)):
        assert moments[0] > 0.0
        assert moments[2] < moments[0] + moments[1]
