"""Names, order, units and nominal values of the standard parameters."""

import numpy as np

from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.robot.friction import FrictionLaw, asymmetric_coulomb, stribeck, viscous
from pivident.robot.gallery import load_robot


def test_order_of_the_tx40(tx40):
    names = [p.name for p in standard_parameters(tx40)]
    first = "xx1 xy1 xz1 yy1 yz1 zz1 mx1 my1 mz1 m1 ia1 fv1 fc1 off1 xx2".split()
    assert names[:15] == first
    assert names[-4:] == ["off6", "iam6", "fvm6", "fcm6"]
    assert len(names) == len(set(names)) == 6 * 14 + 3


def test_units_on_the_joint_side(tx40):
    units = {p.name: p.unit for p in standard_parameters(tx40)}
    assert units["zz1"] == units["ia1"] == units["iam6"] == "kg m²"
    assert units["mx2"] == "kg m" and units["m3"] == "kg"
    assert units["fv1"] == units["fvm6"] == "N m s/rad"
    assert units["fc1"] == units["off1"] == units["fcm6"] == "N m"
    units = {p.name: p.unit for p in standard_parameters(load_robot("emps"))}
    assert (units["ia1"], units["fv1"], units["fc1"]) == ("kg", "N s/m", "N")


def test_every_term_of_a_friction_law_is_a_parameter(tx40):
    law = FrictionLaw((viscous(), *asymmetric_coulomb(), stribeck(0.1)))
    names = [p.name for p in standard_parameters(tx40.with_friction(law))]
    assert names[11:15] == ["fv1", "fcp1", "fcn1", "fs1"]


def test_nominal_values_are_those_of_the_description(tx40):
    parameters = standard_parameters(tx40)
    values = dict(zip([p.name for p in parameters], nominal_values(tx40, parameters), strict=True))
    assert values["m1"] == 8.61 and values["mz4"] == -0.586 and values["ia1"] == 0.362
    assert values["fv1"] == 7.9379 and values["fcm6"] == 1.6 and values["off3"] == 0.0
    assert np.isfinite(list(values.values())).all()


def test_what_must_not_be_negative(tx40):
    dissipative = {p.stem for p in standard_parameters(tx40) if p.is_dissipative}
    assert dissipative == {"ia", "iam", "fv", "fc", "fvm", "fcm"}
    assert {p.stem for p in standard_parameters(tx40) if p.is_inertial} == set(
        "xx xy xz yy yz zz mx my mz m".split()
    )
