"""CLOE, CLIE, ML and OLOE of records whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

import pivident as pv
from pivident.dynamics.forward import make_model
from pivident.dynamics.regressor import Regressor
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.output_error import fit
from pivident.estimation.output_error.output_error import OutputError
from pivident.experiment import simulated_tx40
from pivident.foundation.errors import (
    ExperimentError,
    RankDeficientRegressor,
)
from pivident.loop.simulation.closed_loop import simulate
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.simulated_record import Noise
from tests.estimation.output_error.arms import (
    RATE,
    SAMPLES,
    counted_simulations,
    problem,
    reference,
    signals,
    truth,
)
from tests.planar_arm import LAW, nominal_parameters


@pytest.mark.parametrize("name", ["cloe", "clie", "ml", "oloe"])
def test_intervals_contain_the_truth(name):
    found = [identify(problem(seed), name) for seed in range(3)]
    z = np.array([(f.theta - truth(f.names)) / f.std for f in found])
    assert all(f.converged for f in found)
    # 39 numbers, 95 % of them within two
    assert np.mean(np.abs(z) < 2.0) > 0.85 and np.abs(z).max() < 5.0
    assert np.sqrt(np.mean(z**2)) > 0.3  # intervals are not wide for nothing
    assert found[0].method == {"oloe": "OLOE"}.get(name, name.upper())
    assert not [w for w in found[0].warnings if w.topic in ("law", "simulation")]


def test_positions_and_torques_of_one_loop_agree_with_piv():
    one = problem()
    piv, ml = identify(one, "piv"), identify(one, "ml")
    error = np.abs(piv.theta - ml.theta) / np.hypot(piv.std, ml.std)
    assert (error < 4.0).all()
    assert ml.simulation is not None
    noise = np.sqrt(np.mean((one.recordings[0].q - reference()) ** 2, axis=0))
    assert (ml.simulation.position_rms < 0.01 * noise).all()


@pytest.mark.parametrize(
    ("law", "named"),
    [
        (PD(LAW.kp * [1.03, 1.0], LAW.kd), "kp1 = 6180"),
        (PD(LAW.kp, LAW.kd * [1.0, 1.05]), "kd2 = 63"),
    ],
)
@pytest.mark.parametrize("name", ["cloe", "ml"])
def test_a_gain_that_the_record_contradicts_is_named(law, named, name):
    found = identify(problem(law=law), name)
    wrong = [w for w in found.warnings if w.kind == "wrong gain"]
    assert len(wrong) == 1 and named in wrong[0].message
    declared, change = wrong[0].evidence["declared"].value, wrong[0].evidence["change"].value
    right = 6000.0 if "kp" in named else 60.0
    assert declared * (1.0 + change / 100.0) == pytest.approx(right, rel=3e-3)


def test_a_drive_gain_that_the_torques_contradict_is_named():
    found = identify(problem(drive_gain=(1.1, 1.0)), "ml")
    (wrong,) = [w for w in found.warnings if w.kind == "wrong gain"]
    assert wrong.subject == "drive_gain1"
    assert wrong.evidence["change"].value == pytest.approx(10.0, abs=1.5)


@pytest.mark.parametrize("name", ["cloe", "ml"])
def test_gains_that_are_all_too_large_are_named_by_the_torque(name):
    """Positions fit as well as ever: only the torque tells."""
    found = identify(problem(law=PD(LAW.kp * 1.02, LAW.kd * 1.02)), name)
    (wrong,) = [w for w in found.warnings if w.topic == "law"]
    assert wrong.kind == "other torque"
    torque = wrong.evidence["torque"]
    assert torque.value == pytest.approx(100.0 * (1.0 / 1.02 - 1.0), abs=0.2)
    ratio = found.theta / identify(problem(), name).theta
    assert np.median(ratio) == pytest.approx(1.02, abs=2e-3)


def test_gains_are_identified_where_they_are_free():
    method = OutputError("both", free=("kp", "kd2"))
    found = identify(problem(law=PD(LAW.kp * [1.03, 1.0], LAW.kd)), method)
    assert found.simulation is not None
    gains = {p.name: p for p in found.simulation.loop_parameters}
    assert list(gains) == ["kp1", "kp2", "kd2"]
    for name, right in (("kp1", 6000.0), ("kp2", 2500.0), ("kd2", 60.0)):
        assert abs(gains[name].value - right) < 4.0 * gains[name].std < 0.01 * right
    assert gains["kp1"].unit == "output/rad" and gains["kd2"].unit == "output s/rad"
    assert not [w for w in found.warnings if w.topic == "law"]


def test_constants_that_were_sought_are_those_of_the_resulting_robot():
    one = problem()
    true = [joint.friction.slopes[0] for joint in one.robot.joints]
    joints = tuple(
        replace(joint, friction=joint.friction.with_shapes({"gamma": 100.0}))
        for joint in one.robot.joints
    )
    wrong = replace(one, robot=replace(one.robot, joints=joints))
    found = identify(wrong, OutputError("positions", free=("gamma",)))
    assert found.simulation is not None
    for own, joint, right in zip(
        found.simulation.loop_parameters, found.robot.joints, true, strict=True
    ):
        assert joint.friction.slopes[0] == own.value
        assert abs(own.value - right) < 4.0 * own.std < 0.05 * right
    # torques of the result are those of the true arm, which other constants would not give
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.standard_normal((3, 50, 2)) * [[[1.0]], [[5e-3]], [[1.0]]]
    base, theta = nominal_parameters()
    expected = Regressor.build(base.robot, base.parameters).torque(q, dq, ddq, theta)
    np.testing.assert_allclose(found.predict(q, dq, ddq), expected, atol=0.02)
    stale = Regressor.build(wrong.robot, wrong.regressor.parameters)
    assert np.abs(stale.torque(q, dq, ddq, found.theta) - expected).max() > 0.2


def delayed(seconds: float, declared: float = 0.0) -> pv.Problem:
    """A record whose drives answer late."""
    base, theta = nominal_parameters()
    noise = 2e-6 * np.random.default_rng(5).standard_normal(reference().shape)
    loop = replace(signals(drive_delay=seconds), noise=noise)
    made = simulate(make_model(base.robot, base.parameters, theta), LAW, loop, ("1", "2"))
    recording = pv.Recording.from_arrays(
        made.q + noise,
        made.command,
        RATE,
        joint_names=base.robot.joint_names,
        q_ref=reference(),
        drive_delay=declared,
    )
    return pv.Problem(base.robot, (recording,), pv.Loop(LAW))


@pytest.mark.parametrize("compares", ["positions", "both"])
def test_a_delay_is_named_or_found(compares):
    wrong = [w for w in identify(delayed(6e-4), OutputError(compares)).warnings]
    (late,) = [w for w in wrong if w.kind == "wrong delay"]
    assert late.evidence["delay"].value == pytest.approx(6e-4, rel=0.05)
    found = identify(delayed(6e-4), OutputError(compares, free=("delay",)))
    assert found.simulation is not None
    (delay,) = found.simulation.loop_parameters
    assert abs(delay.value - 6e-4) < 4.0 * delay.std < 3e-5
    z = (found.theta - truth(found.names)) / found.std
    assert np.mean(np.abs(z) < 2.0) > 0.75 and np.abs(z).max() < 5.0


def test_noise_in_the_loop_does_not_bias_friction(monkeypatch):
    # noise that shakes the joints at their reversals makes friction seem smaller; a simulation
    # without noise does not know of it
    monkeypatch.setitem(simulated_tx40.NOISES, "shaken", Noise(encoder=8e-5))
    own, true = simulated_tx40.tx40_scenario("shaken", 0)
    error, std = {}, {}
    for name in ("with", "without"):
        if name == "without":
            monkeypatch.setattr(fit, "loop_noise", lambda own: np.zeros(own.loop.robot.size))
        made = identify(own, "cloe")
        expected = np.array([true[p.name] for p in made.parameters])
        error[name], std[name] = (made.theta - expected) / expected, made.std / np.abs(expected)
    friction = [k for k, p in enumerate(made.parameters) if p.stem in ("fc", "fv")]
    assert np.linalg.norm(error["with"][friction]) < 0.5 * np.linalg.norm(
        error["without"][friction]
    )
    assert np.median(std["with"]) < 0.5 * np.median(std["without"])
    assert np.abs(error["with"] / std["with"]).max() < 3.0


def test_kinds_of_covariance():
    made = {
        kind: identify(problem(), OutputError("positions", covariance=kind))
        for kind in ("auto", "sandwich", "formula")
    }
    for kind, own in made.items():
        np.testing.assert_allclose(own.theta, made["auto"].theta)
        ratio = own.std / made["formula"].std
        assert (ratio > 0.3).all() and (ratio < 3.0).all(), kind
        np.testing.assert_allclose(own.formula_covariance, made["formula"].covariance)
    assert not np.allclose(made["sandwich"].std, made["formula"].std)


def test_an_open_loop_may_be_cut_into_segments():
    found = identify(problem(), replace(METHODS["oloe"], horizon=1.0))
    z = (found.theta - truth(found.names)) / found.std
    assert found.converged and np.mean(np.abs(z) < 2.0) > 0.7
    assert found.loop is None


def test_bounds_of_a_friction_that_is_not_there():
    found = identify(problem(), OutputError("positions", bounds={"fv2": (0.0, 0.5), "zz2": (0, 9)}))
    assert found.simulation is not None
    true = truth(("fv2",))[0]
    if true > 0.5:
        assert found.simulation.at_bound == ("fv2",)
        (warning,) = [w for w in found.warnings if w.kind == "at bound"]
        low, high = warning.evidence["fv2"].interval
        assert high == pytest.approx(0.5) and low < high
        assert "one side" in warning.message


def test_scale_that_positions_do_not_know():
    free = OutputError("positions", free=("drive_gain",))
    with pytest.raises(RankDeficientRegressor, match="drive_gain"):
        identify(problem(), free)
    found = identify(problem(), replace(free, undetermined="hold"))
    assert found.simulation is not None and len(found.simulation.held) == 1
    (warning,) = [w for w in found.warnings if w.kind == "undetermined"]
    assert found.simulation.held[0] in warning.message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"compares": "speeds"}, "compares is 'speeds'"),
        ({"loop": "open"}, "only positions can be compared"),
        ({"horizon": 0.0}, "horizon is 0.0; it has to be positive"),
        ({"horizon": "minutes"}, "horizon is 'minutes'"),
        ({"bandwidth": 0.0}, "bandwidth is 0"),
        ({"loss": "absolute"}, "loss is 'absolute'"),
        ({"undetermined": "drop"}, "undetermined is 'drop'"),
        ({"tolerance": 2.0}, "tolerance is 2.0; it lies between 0 and 1"),
    ],
)
def test_options_that_mean_nothing_are_refused(options, message):
    with pytest.raises(ExperimentError, match=message):
        OutputError(**options)


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (OutputError(free=("kpp",)), r"free names 'kpp'.*kp"),
        (OutputError(free=("ki3",)), r"free names 'ki3'"),
        (OutputError(bounds={"fv9": (0.0, 1.0)}), r"bounds names 'fv9'.*not sought"),
        (OutputError(bounds={"fv1": (1.0, 0.0)}), r"bounds of fv1 are 1 and 0"),
    ],
)
def test_unknowns_that_there_are_not_are_refused(method, message):
    with pytest.raises(ExperimentError, match=message):
        identify(problem(samples=1500), method)


def test_what_is_no_closed_loop_is_refused():
    own = problem(samples=1500)
    with pytest.raises(ExperimentError, match=r"simulates the closed loop.*oloe"):
        identify(replace(own, loop=None), "cloe")
    virtual = pv.Loop(LAW, reference="smoothed")
    with pytest.raises(ExperimentError, match="the measurement itself takes its place"):
        identify(replace(own, loop=virtual), "ml")


def test_several_records_share_the_parameters():
    parts = problem(samples=SAMPLES)
    whole = identify(parts, "cloe")
    one = parts.recordings[0]
    halves = (one.part(0, SAMPLES // 2), one.part(SAMPLES // 2, SAMPLES))
    named = (replace(halves[0], name="first"), replace(halves[1], name="second"))
    found = identify(replace(parts, recordings=named), "cloe")
    z = (found.theta - whole.theta) / np.hypot(found.std, whole.std)
    assert (np.abs(z) < 4.0).all() and found.converged


def test_records_without_noise_are_fitted():
    one = replace(problem(noise=0.0), mask=None)
    found = identify(one, OutputError("positions"))
    assert found.converged
    np.testing.assert_allclose(found.theta, truth(found.names), rtol=0.02, atol=0.02)


def test_derivatives_of_an_open_loop_are_never_kept(monkeypatch):
    # its errors grow with time: behind a step of 1 % standard errors were a quarter too small
    runs = counted_simulations(monkeypatch)
    found = identify(problem(), "oloe")
    assert len(runs) == found.iterations and all(runs)
