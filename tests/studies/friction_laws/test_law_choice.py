"""Choice among friction laws by held-out error. Long: benchmarks/friction_law_recovery.py."""

import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.held_out.segment_sums import (
    Segments,
    SegmentSums,
    effective_rows,
)
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_viscous,
    coulomb,
    counterbalance,
    dahl,
    law_toml,
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
from pivident.signals.bandpass import butterworth
from pivident.studies.friction_laws.chosen_laws import judged, simplest
from pivident.studies.friction_laws.held_out_cells import Division
from pivident.studies.friction_laws.law_candidates import Reach, adding, default_changes, key_of
from pivident.studies.friction_laws.law_choice import choose_laws, with_laws
from pivident.studies.friction_laws.law_scores import LawScore, impossible_signs
from tests.planar_log import EXPERIMENT, write_experiment
from tests.studies.friction_laws.friction_axis import Axis, Noise
from tests.studies.friction_laws.friction_cases import CASES

BASE = FrictionLaw((viscous(), coulomb(), offset()))
NOISE = Noise(encoder=2e-7, torque=0.3)


def problem(name, seed=0, seconds=12.0):
    return Axis(CASES[name].truth, seconds, NOISE).problem(BASE, seed)


@pytest.mark.parametrize(
    ("name", "change", "seconds"),
    [("Coulomb", "present law", 6.0), ("Stribeck", "Stribeck", 12.0), ("load", "load", 6.0)],
)
def test_finds_the_law_that_was_there(name, change, seconds):
    """Half a record does, but for the few slow reversals that show the excess of Stribeck."""
    choice = choose_laws(problem(name, seconds=seconds)).joint("axis")
    assert choice.chosen.name == change
    assert name == "Coulomb" or choice.rejected(choice.base)


@pytest.mark.parametrize("method", ["ls", "piv"])
def test_rows_of_other_estimators(method):
    """Decimated rows, and prefiltered ones with instruments; the share of the load is 0.15."""
    load = default_changes(Reach(travel=1.9, fastest=2.1))["load"]
    choice = choose_laws(problem("load"), method, changes={"load": load}).joint("axis")
    assert choice.chosen.name == "load"
    assert choice.chosen.theta[-1] == pytest.approx(0.15, rel=0.02)


def test_memory_is_told_from_smooth_friction():
    changes = choose_laws(problem("Dahl", seconds=6.0), depth=1)
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
    """Oracle: plain least squares without the block, its error low-passed sample by sample."""
    given = problem("Stribeck")
    choice = choose_laws(given, changes={}, folds=4, gap=0.6, band=25.0).joint("axis")
    found = identify(given, LeastSquares(signals=RandomWalk()))
    (record,) = found.equations.records
    k = record.kinematics
    phi = given.regressor.matrix(k.q.T, k.dq.T, k.ddq.T)[:, 0]
    tau, used = k.tau[0], record.used[0]
    moving = np.flatnonzero(np.abs(k.dq[0]) > given.low_speeds(k.recording)[0])
    start, stop = max(moving[0], k.start), min(moving[-1] + 1, k.stop)
    borders = np.linspace(start, stop, 5)  # 12 s: no finer cells than the blocks
    sample = np.arange(tau.size)
    rate = k.recording.rate
    near = [np.abs(sample - b) < 0.5 * 0.6 * rate for b in borders[1:-1]]
    inside = used & (sample >= start) & (sample < stop)
    judged_rows = sample % int(rate / (4.0 * 25.0)) == 0
    low_phi, low_tau = butterworth(phi, rate, 25.0), butterworth(tau[:, None], rate, 25.0)[:, 0]
    cells = []
    for fold in range(4):
        block = (sample >= borders[fold]) & (sample < borders[fold + 1])
        others = inside & ~block
        for i, zone in enumerate(near):  # gaps beside other blocks are fitted
            if i in (fold - 1, fold):
                others &= ~zone
        theta = np.linalg.lstsq(phi[others], tau[others], rcond=None)[0]
        held_out = inside & block & ~np.any(near, axis=0) & judged_rows
        cells.append((held_out.sum(), np.sum((low_tau - low_phi @ theta)[held_out] ** 2)))
    rows, squares = np.array(cells).T
    blocks = choice.base.held_out[:4].sum(axis=0)
    # the first four divisions hold out one block each; all ten hold out each cell 1 + 6/4 times
    shares = sum((choice.base.held_out > 0.0).sum(axis=1)) / 4.0
    assert blocks * shares == pytest.approx(squares / rows.mean(), rel=1e-7)


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
    """A law by its errors in eight cells, four of each of two recordings."""
    held_out = np.zeros((2, 8))
    held_out[0, :4], held_out[1, 4:] = errors[:4], errors[4:]
    std = np.full(3, 0.1)
    return LawScore(name, BASE, unknowns, held_out, 1.0, np.array(theta), std, bic=bic)


RECORDINGS = [Division("A", np.arange(8) < 4), Division("B", np.arange(8) >= 4)]
PLAIN = score("plain", 3, [2.0, 2.1, 1.9, 2.0, 2.05, 1.95, 2.0, 2.1], 0.0)


def verdict(name, unknowns, errors, bic, theta=(1.0, 1.0, 0.0), tests=10):
    (made,) = judged([score(name, unknowns, errors, bic, theta)], PLAIN, RECORDINGS, tests)
    return made.verdict


def test_a_change_that_adds_an_unknown_has_to_be_significant_among_all_that_were_tried():
    half = [1.0, 1.3, 0.9, 1.2, 1.1, 0.8, 1.0, 1.2]
    assert verdict("half", 4, half, -50.0) == ""
    assert verdict("half", 4, half, 1.0) == "gain too small for its unknowns"
    little = [1.5, 2.0, 1.7, 1.8, 2.1, 1.7, 1.8, 1.9]
    assert verdict("little", 4, little, -50.0) == "no significant gain"
    assert verdict("little", 4, little, -50.0, tests=1) == ""
    assert verdict("as many unknowns", 3, little, -50.0) == ""
    assert verdict("none", 3, PLAIN.errors + 0.01, -50.0) == "no gain beyond a standard error"


def test_a_gain_has_to_show_in_sum_and_cell_by_cell():
    loud_and_quiet = [20.0, 0.2, 19.0, 0.21, 20.0, 0.2, 21.0, 0.19]
    plain = score("plain", 3, loud_and_quiet, 0.0)
    lower = np.array([0.9, 1.3, 0.91, 1.28, 0.9, 1.3, 0.89, 1.31])  # where it is loud alone
    for factors, reason in ((lower, "no gain beyond a standard error"), (lower - 0.4, "")):
        (made,) = judged([score("new", 3, factors * loud_and_quiet, -9.0)], plain, RECORDINGS, 9)
        assert made.verdict == reason


def test_a_law_must_not_be_worse_on_one_of_the_motions():
    one = [0.1, 0.12, 0.1, 0.11, 2.3, 2.2, 2.25, 2.4]
    assert verdict("fits A only", 3, one, -50.0) == "worse on B"


def test_impossible_signs_are_refused_whatever_they_gain():
    theta = (1.0, -1.0, 0.0)
    assert verdict("negative", 4, np.full(8, 0.1), -200.0, theta) == (
        "impossible sign: fc = -1.00 ± 0.20"
    )
    assert verdict("negative offset", 3, np.full(8, 0.1), -200.0, (1.0, 1.0, -3.0)) == ""


@pytest.mark.parametrize("term", [stribeck(0.1), power_viscous(2.0)])
def test_stribeck_excess_and_powers_of_the_speed_are_not_negative(term):
    law = FrictionLaw((viscous(), term))
    assert impossible_signs(law, [1.0, -0.2], [0.1, 0.1]) == (f"{term.stem} = -0.20 ± 0.20",)
    assert impossible_signs(law, [1.0, 0.2], [0.1, 0.1]) == ()


def test_the_simplest_law_within_a_standard_error_of_the_best():
    better = score("better", 4, [1.0, 1.1, 1.0, 1.1, 1.0, 1.1, 1.0, 1.1], -50.0)
    lucky = score("lucky", 6, [0.99, 1.09, 0.99, 1.09, 0.99, 1.09, 0.99, 1.09], -40.0)
    within = score("within", 7, [0.9, 1.3, 0.8, 1.1, 0.9, 1.3, 0.8, 1.1], -51.0)
    assert simplest([PLAIN, better, lucky, within]).name == "better"
    assert simplest([PLAIN, lucky]).name == "lucky"


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


def test_gaps_belong_to_no_neighbouring_cell():
    labels = np.repeat([0, 1, 2, 3, 4], 10)
    segments = Segments((labels,), 3)

    def fitted(*held_out):
        return segments.training(np.isin(np.arange(3), held_out)).tolist()

    assert fitted(0) == [2, 3, 4]
    assert fitted(1) == [0, 4]
    assert fitted(0, 1) == [4]
    assert segments.parts(0) == [(i, slice(10 * i, 10 * i + 10)) for i in range(5)]


def test_sums_with_further_columns_are_those_of_all_columns():
    """Oracle: the same rows summed at once; with and without instruments."""
    rng = np.random.default_rng(0)
    segments = Segments((np.repeat([0, 1, 2], [30, 5, 40]),), 2)
    phi, z, tau = (
        rng.standard_normal((5, 75)),
        rng.standard_normal((5, 75)),
        rng.standard_normal(75),
    )
    used = np.ones(75)
    for instruments in (None, z):
        few = None if instruments is None else instruments[:3]
        more = None if instruments is None else instruments[3:]
        rows = [(phi[:3], few, tau, used)]
        grown = SegmentSums.of(rows, segments).with_columns(rows, [(phi[3:], more)], segments)
        left = phi if instruments is None else instruments
        for label, span in enumerate((slice(0, 30), slice(30, 35), slice(35, 75))):
            np.testing.assert_allclose(grown.zf[label], left[:, span] @ phi[:, span].T, atol=1e-12)
            np.testing.assert_allclose(grown.zt[label], left[:, span] @ tau[span], atol=1e-12)
            np.testing.assert_allclose(grown.ff[label], phi[:, span] @ phi[:, span].T, atol=1e-12)


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

    from pivident.robot.mdh_keys import FrictionTerms
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


@pytest.mark.parametrize("lines", ['[robot.joint_friction]\n"elbow" = []', ""])
def test_chosen_laws_are_written_where_asked(tmp_path, capsys, monkeypatch, lines):
    """The lines that are printed; no file where no law changes."""
    choice = SimpleNamespace(toml=lambda: lines, problem=None)
    monkeypatch.setattr(
        "pivident.studies.friction_laws.law_choice.choose_laws", lambda *a, **k: choice
    )
    monkeypatch.setattr("pivident.app.cli.laws._checked", lambda *given: "checked")
    experiment = write_experiment(tmp_path, EXPERIMENT)
    out = tmp_path / "found" / "laws.toml"
    assert main(["laws", str(experiment), "--out", str(out)]) == 0
    assert out.is_file() == bool(lines)
    if lines:
        assert tomllib.loads(out.read_text("utf-8")) == {"robot": {"joint_friction": {"elbow": []}}}
        assert "belongs in" in capsys.readouterr().err
