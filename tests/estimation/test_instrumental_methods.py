"""IV and PIV: what they say they are, which rows IV keeps, which prefilter PIV takes."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.identify import identify
from pivident.estimation.instrumental_variables import DecimatedSteps, InstrumentalVariables
from pivident.estimation.iteration import Pass, Signals, Simulated
from pivident.estimation.method import Arma, AutoRegressive
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.prefiltered_iv import PIV, PIV_AS_PRINTED, PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Algebraic, Bandpass, RandomWalk
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.control_loop import Loop
from tests.planar_arm import LAW, nominal_parameters, planar_motion, planar_record
from tests.synthetic_identification import synthetic_loop


@pytest.mark.parametrize(
    ("signals", "label", "decimated"),
    [
        (Bandpass(), "IDIM-IV", True),
        (Bandpass(decimation=1), "IDIM-IV", False),
        (Algebraic(), "IDIM-IV", True),
        (Algebraic(decimation=1), "IDIM-IV (full rate)", False),
        (RandomWalk(), "IDIM-IV (full rate)", False),
    ],
)
def test_iv_says_whether_its_equations_are_decimated(signals, label, decimated):
    method = InstrumentalVariables(signals=signals)
    assert (method.label, "decimated" in method.summary) == (label, decimated)


def test_as_printed_is_for_comparison():
    """λ⁻¹ on both sides of (P-22) and (P-28), and what the paper says of smoother and noise."""
    assert (PIV.whitens, PIV_AS_PRINTED.whitens) == (True, None)
    assert (PIV.weight_power, PIV_AS_PRINTED.weight_power) == (1.0, 2.0)
    assert PIV_AS_PRINTED.signals == RandomWalk(order=2, passes=2, align=False)
    assert (PIV_AS_PRINTED.covariance, PIV_AS_PRINTED.start) == ("formula", "initial")
    assert PIV_AS_PRINTED.noise == AutoRegressive(on_unmasked=False, motion_band=None)
    assert PrefilteredIV(as_printed=True, noise=Arma(8, 4)).noise == Arma(8, 4, on_unmasked=False)
    with pytest.raises(ExperimentError, match="'virtual', but IDIM-PIV"):
        PrefilteredIV(as_printed=True, instruments="virtual")


@pytest.mark.parametrize(("noise", "better"), [("encoder", "controller"), ("torque", "direct")])
def test_an_identified_law_is_inverted_where_that_is_more_precise(noise, better):
    """A PD law differentiates encoder noise: no AR(2) whitens that, but the law's inverse does."""
    base, theta = nominal_parameters()
    rng = np.random.default_rng(4)
    reference = planar_motion(rng, 1000.0, 4000)
    encoder, drive = (2e-5, 0.0) if noise == "encoder" else (2e-7, 0.5)
    q, tau = planar_record(base, theta, reference, 1000.0, rng, encoder_noise=encoder)
    tau += drive * rng.standard_normal(tau.shape)
    record = Recording("run", base.robot.joint_names, q, tau, 1000.0, q_ref=reference)
    loops = {
        "given": Loop(LAW),
        "identified": Loop(LAW, identified=synthetic_loop("law").identified),
    }

    def estimate(loop, prefilter):
        method = PrefilteredIV(prefilter=prefilter, noise=AutoRegressive(2))
        return identify(Problem(base.robot, (record,), loops[loop]), method)

    found = {kind: estimate("identified", kind) for kind in ("controller", "direct")}
    deviation = {kind: np.log(own.std).mean() for kind, own in found.items()}
    assert min(deviation, key=deviation.get) == better
    np.testing.assert_array_equal(estimate("identified", "auto").theta, found[better].theta)
    np.testing.assert_array_equal(estimate("given", "auto").theta, found["controller"].theta)


@pytest.mark.parametrize(("start", "first"), [("initial", 0), ("least-squares", 1)])
def test_decimated_rows_stay_from_the_fourth_iteration_on(start, first):
    """Columns of the measured motion are made once; which rows count may change four times."""
    base, theta = nominal_parameters()
    rng = np.random.default_rng(4)
    reference = planar_motion(rng, 1000.0, 2000)
    q, tau = planar_record(base, theta, reference, 1000.0, rng)
    record = Recording("run", base.robot.joint_names, q, tau, 1000.0, q_ref=reference)
    problem = Problem(base.robot, (record,), Loop(LAW))
    method = InstrumentalVariables(start=start)
    signals, source = Signals.of(problem, method), AuxiliaryModel(problem, differences=False)
    steps = DecimatedSteps(signals, method, source, method.signals)
    simulated = Simulated(*source.simulate_or_halve(None, theta))
    last = Pass(0, theta, None, (), Prefilters(()))
    (fresh,), _ = steps.equations(last, simulated, last.prefilters)
    nothing = replace(fresh, used=np.zeros_like(fresh.used))
    assert fresh.used.any()
    for iterations, kept in ((1, fresh), (3, fresh), (4, nothing), (9, nothing)):
        last = Pass(first + iterations, theta, theta, (nothing,), Prefilters(()))
        (again,), _ = steps.equations(last, simulated, last.prefilters)
        assert again.phi is fresh.phi and again.tau is fresh.tau
        np.testing.assert_array_equal(again.z, fresh.z)
        np.testing.assert_array_equal(again.used, kept.used)
