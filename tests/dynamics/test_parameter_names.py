"""What parameters are called, in words."""

import pytest

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import standard_parameters
from pivident.estimation.summary import names_in_words


def words_of(name):
    base = base_parameters(pv.load_robot(name))
    return names_in_words(dict(zip(base.names, base.parameters, strict=True)))


@pytest.mark.parametrize("name", ["staubli_tx40", "delta", "quadruped", "emps"])
def test_every_stem_is_explained_once(name):
    base = base_parameters(pv.load_robot(name))
    explained = [
        stem.strip() for part in words_of(name).split(";") for stem in part.split(":")[0].split(",")
    ]
    stems = {p.stem for p in base.parameters}
    assert stems <= set(explained) and len(explained) == len(set(explained))


def test_groups_and_numbers_are_explained_where_there_are_some():
    assert "with r: together with others" in words_of("staubli_tx40")
    assert "counted from the base" in words_of("staubli_tx40")
    assert "counted from the base" not in words_of("delta")  # joints have names there
    standard = standard_parameters(pv.load_robot("planar_2r"))
    assert "with r" not in names_in_words({p.name: p for p in standard})


def test_terms_of_other_friction_laws_are_said_to_be_such():
    from pivident.robot.friction import FrictionLaw, lugre, viscous

    robot = pv.load_robot("planar_2r").with_friction(
        FrictionLaw((viscous(), *lugre(5e-2, 0.3, 0.5)))
    )
    base = base_parameters(robot)
    text = names_in_words(dict(zip(base.names, base.parameters, strict=True)))
    assert "fv: viscous friction" in text and "further terms of the friction law" in text
