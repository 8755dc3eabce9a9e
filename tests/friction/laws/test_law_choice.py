"""Choice among friction laws by held-out error. Long: benchmarks/friction_law_recovery.py."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from pivident.cli import main
from pivident.errors import IdentificationError
from pivident.estimation.identify import identify
from pivident.estimation.methods import LeastSquares, RandomWalk
from pivident.friction.laws.chosen_laws import chosen_law
from pivident.friction.laws.law_candidates import adding, key_of
from pivident.friction.laws.law_choice import choose_laws, with_laws
from pivident.friction.laws.law_scores import LawScore
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_viscous,
    coulomb,
    counterbalance,
    dahl,
    load_dependent,
    lugre,
    maxwell_slip,
    offset,
    power_viscous,
    ripple,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.friction_toml import law_toml
from pivident.validation.held_out.segment_sums import Segments, effective_rows
from tests.friction.laws.friction_axis import Axis, Noise
from tests.friction.laws.friction_cases import CASES

BASE = FrictionLaw((viscous(), coulomb(), offset()))
NOISE = Noise(encoder=2e-7, torque=0.3)


def problem(name, seed=0):
    return Axis(CASES[name].truth, noise=NOISE).problem(BASE, seed)


@pytest.mark.parametrize(
    ("name", "change"), [("Coulomb", "present law"), ("Stribeck", "Stribeck"), ("load", "load")]
)
def test_finds_the_law_that_was_there(name, change):
    choice = choose_laws(problem(name)).joint("axis")
    assert choice.chosen.name == change
    assert name == "Coulomb" or choice.rejected(choice.base)


def test_memory_is_told_from_smooth_friction():
    changes = choose_laws(problem("Dahl"), depth=1)
    choice = changes.joint("axis")
    assert choice.chosen.name == "Dahl"
    assert choice.chosen.law.with_shapes({}).shapes[0].value == pytest.approx(0.01, rel=0.05)
    wrong = [s for s in choice.scores if s.name not in ("Dahl", "LuGre")]
    assert all(choice.rejected(s) for s in wrong)
    assert "→  Dahl" in str(changes)
    assert (
        changes.problem.robot.joints[0].friction
        == changes.problem.robot.with_friction(choice.chosen.law).joints[0].friction
    )


def test_a_ripple_that_is_asked_for():
    more = {"axis": {"ripple": adding(ripple(20, "a"))}}
    choice = choose_laws(problem("ripple"), changes={}, more=more).joint("axis")
    assert choice.chosen.name == "ripple"
    assert choice.gain(choice.chosen).percent > 30.0


def test_held_out_errors_are_those_of_separate_fits():
    """Oracle: the block left out of a plain least-squares fit on the dense matrix."""
    given = problem("Stribeck")
    choice = choose_laws(given, changes={}, folds=4, gap=0.2).joint("axis")
    found = identify(given, LeastSquares(signals=RandomWalk()))
    (record,) = found.equations.records
    k = record.kinematics
    phi = given.regressor.matrix(k.q.T, k.dq.T, k.ddq.T)[:, 0]
    tau, votes = k.tau[0], record.used[0]
    moving = np.flatnonzero(np.abs(k.dq[0]) > given.low_speeds(k.recording)[0])
    start, stop = max(moving[0], k.start), min(moving[-1] + 1, k.stop)
    borders = np.linspace(start, stop, 5)
    sample = np.arange(tau.size)
    half = 0.5 * 0.2 * k.recording.rate
    near = [np.abs(sample - b) < half for b in borders[1:-1]]
    gaps = np.any(near, axis=0)
    for fold in range(4):
        block = (sample >= borders[fold]) & (sample < borders[fold + 1])
        others = votes & ~block & (sample >= start) & (sample < stop)
        for i, zone in enumerate(near):  # gaps beside other blocks are fitted
            if i in (fold - 1, fold):
                others &= ~zone
        theta = np.linalg.lstsq(phi[others], tau[others], rcond=None)[0]
        held_out = votes & block & ~gaps
        expected = np.mean((tau[held_out] - phi[held_out] @ theta) ** 2)
        assert choice.base.errors[fold] == pytest.approx(expected, rel=1e-9)


def test_terms_of_the_new_law_join_a_choice_of_parameters():
    given = replace(problem("Coulomb"), parameters=("zz1", "fv1", "fc1"), initial={"fc1": 4.0})
    law = FrictionLaw((viscous(), dahl(0.01)))
    changed = with_laws(given, {"axis": law})
    assert changed.names == ("zz1r", "fv1", "fc1")
    assert changed.initial == {"fc1": 4.0}
    without = with_laws(given, {"axis": FrictionLaw((viscous(), *maxwell_slip([0.01, 0.1])))})
    assert without.names == ("zz1r", "fv1", "fma1", "fmb1")
    assert without.initial == {}


def score(name, unknowns, errors, bic, theta=(1.0, 1.0, 0.0)):
    return LawScore(
        name, BASE, unknowns, np.array(errors, float), 1.0, np.array(theta), bic=bic, aic=bic
    )


def test_rule_of_choice():
    plain = score("plain", 3, [2.0, 2.1, 1.9, 2.0], 0.0)
    better = score("better", 4, [1.0, 1.1, 1.0, 1.1], -50.0)
    lucky = score("lucky", 6, [0.99, 1.09, 0.99, 1.09], -40.0)
    within = score("within", 7, [0.9, 1.3, 0.8, 1.1], -51.0)
    assert chosen_law([plain, better, lucky, within]).name == "better"
    assert chosen_law([plain, lucky]).name == "lucky"
    negative = score("negative", 4, [0.1, 0.1, 0.1, 0.1], -200.0, (1.0, -1.0, 0.0))
    assert not negative.physical
    assert chosen_law([plain, negative]).name == "plain"


def test_effective_rows_of_an_autoregression():
    """n (1 - a)/(1 + a) for x_t = a x_{t-1} + e_t."""
    rng = np.random.default_rng(0)
    e = rng.standard_normal(200_000)
    x = np.empty_like(e)
    x[0] = e[0]
    for k in range(1, e.size):
        x[k] = 0.8 * x[k - 1] + e[k]
    assert effective_rows([x]) == pytest.approx(e.size / 9.0, rel=0.1)
    assert effective_rows([e]) == pytest.approx(e.size, rel=0.1)


def test_gaps_belong_to_no_neighbouring_fold():
    labels = np.repeat([0, 1, 2, 3, 4], 10)
    segments = Segments((labels,), 3)
    assert segments.training(0).tolist() == [2, 3, 4]
    assert segments.training(1).tolist() == [0, 4]
    assert segments.parts(0) == [(i, slice(10 * i, 10 * i + 10)) for i in range(5)]


@pytest.mark.parametrize(
    "law",
    [
        BASE,
        FrictionLaw((*asymmetric_viscous(), coulomb("tanh", 30.0), stribeck(0.1, 1.5))),
        FrictionLaw((power_viscous(0.4), load_dependent(), *ripple(12.5, "a"), spring())),
        FrictionLaw((viscous(), dahl(1e-5), *counterbalance(0.4, 0.2))),
        FrictionLaw((viscous(), *lugre(1e-5, 0.3, 0.02))),
        FrictionLaw((viscous(), *maxwell_slip([1e-5, 2e-5], 0.2, 0.1, 1.5))),
    ],
)
def test_lines_for_the_experiment_file_give_the_same_law(law):
    from pydantic import TypeAdapter

    from pivident.robot.mdh_schema import FrictionTerms
    from pivident.robot.modified_dh import friction_law

    entries = tomllib.loads(f"law = {law_toml(law)}")["law"]
    again = friction_law(TypeAdapter(FrictionTerms).validate_python(entries))
    assert key_of(again) == key_of(law)
    assert {s.name: s.value for s in again.shapes} == {s.name: s.value for s in law.shapes}
    assert {t.stem: t.gamma for t in again.terms} == {t.stem: t.gamma for t in law.terms}


def test_errors_name_the_next_step():
    given = problem("Coulomb")
    with pytest.raises(IdentificationError, match="at least 3"):
        choose_laws(given, folds=2)
    with pytest.raises(IdentificationError, match="DIDIM"):
        choose_laws(given, "didim")
    short = replace(given, recordings=(given.recordings[0].slice(0.0, 2.0),))
    with pytest.raises(IdentificationError, match="use fewer"):
        choose_laws(short, folds=40, gap=0.2)


def test_a_depth_of_nothing_is_refused(tmp_path, capsys):
    (tmp_path / "arm.toml").write_text('robot = "planar_2r"\n')
    assert main(["laws", str(tmp_path / "arm.toml"), "--depth", "0"]) == 1
    assert "--depth 0 leaves no law to try" in capsys.readouterr().err
