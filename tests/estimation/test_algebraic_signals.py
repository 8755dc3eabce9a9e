"""Algebraic differentiation as the signals of methods: windows, torque, accuracy, files."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identification_file import method_of_options, to_json
from pivident.estimation.identify import identify
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.kinematics import estimate_kinematics, settled_recipe
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.methods import METHODS
from pivident.estimation.signal_recipes import Algebraic, Bandpass
from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.foundation.errors import ExperimentError
from pivident.judgement.report.builder import render_report
from tests.planar_simulations import planar_problem


def test_the_window_has_half_gain_at_the_cut_off_of_the_band_pass():
    recordings = planar_problem().recordings
    window = settled_recipe(Algebraic(), recordings)
    cutoff = settled_recipe(Bandpass(), recordings)
    np.testing.assert_allclose(window.cutoffs(2), cutoff.cutoffs(2), rtol=5e-3)
    assert window.bandwidth == cutoff.bandwidth
    assert settled_recipe(window, recordings) == window


def test_both_sides_of_a_linear_equation_are_filtered_alike():
    """τ = J ddq + fv dq holds behind the window, however much of the motion the window takes."""
    rate, t = 500.0, np.arange(4000) / 500.0
    omega = 2 * np.pi * 6.0
    q = np.sin(omega * t)
    tau = -2.0 * omega**2 * np.sin(omega * t) + 0.7 * omega * np.cos(omega * t)
    record = Recording(
        "sine", ("joint_1",), q[:, None], tau[:, None], rate, torque_timing="sampled"
    )
    k = estimate_kinematics(record, Algebraic(window=0.25, bandwidth=20.0))
    part = slice(k.start, k.stop)
    columns = np.stack([k.ddq[0, part], k.dq[0, part]], axis=1)
    found = np.linalg.lstsq(columns, k.tau[0, part], rcond=None)[0]
    np.testing.assert_allclose(found, [2.0, 0.7], rtol=1e-4)
    assert np.abs(k.tau[0, part]).max() < 0.9 * np.abs(tau).max()
    plain = estimate_kinematics(record, Algebraic(window=0.25, bandwidth=20.0, both_sides=False))
    np.testing.assert_array_equal(plain.tau[0], tau)


def test_at_the_full_rate_the_torque_keeps_its_white_noise():
    assert Algebraic().filters_torque and not Algebraic(decimation=1).filters_torque
    assert Algebraic(decimation=1, both_sides=True).filters_torque


@pytest.mark.parametrize("method", ["ls", "iv"])
def test_it_is_more_accurate_than_the_band_pass_on_a_simulated_arm(method):
    """Median errors over two seeds of the TX40 with torque noise: 0.04 % against 0.13 %."""
    errors = {}
    for recipe in (Algebraic(), Bandpass()):
        own = []
        for seed in range(2):
            problem, truth = tx40_scenario("fine", seed)
            found = identify(problem, replace(METHODS[method], signals=recipe))
            values = np.array(list(truth.values()))
            own.append(np.abs(found.theta / values - 1.0))
            if isinstance(recipe, Algebraic):
                inside = np.abs(found.theta - values) < 1.96 * found.std
                assert inside.mean() > 0.85
        errors[type(recipe)] = np.median(own)
    assert errors[Algebraic] < 0.6 * errors[Bandpass]
    assert errors[Algebraic] < 1e-3


@pytest.mark.parametrize(
    "name", ["ols", "tls", "irls", "ridge", "map", "ml-ls", "adaline", "iv", "iv-full-rate"]
)
def test_every_method_with_a_choice_of_signals_takes_it(name):
    problem = planar_problem()
    decimation = 1 if name == "iv-full-rate" else None
    own = replace(METHODS[name], signals=Algebraic(decimation=decimation))
    found, theirs = identify(problem, own), identify(problem, name)
    scale = np.linalg.norm(theirs.theta)
    assert np.linalg.norm(found.theta - theirs.theta) < 0.05 * scale
    assert "IDIM-IV (full rate)" == found.method or name != "iv-full-rate"


def test_a_result_names_its_windows_and_its_file_gives_the_method_back():
    found = identify(planar_problem(), LeastSquares(signals=Algebraic()))
    assert "Signals: positions in windows with half gain at 50.0 Hz" in str(found)
    options = json.loads(to_json(found))["options"]
    assert method_of_options(options, None, found.method) == found.method_used
    assert "Windows of the positions" in render_report([found])


def test_options_that_make_no_kernel_are_refused():
    with pytest.raises(ExperimentError, match=r"exponent is 1\.5; it lies between 2 and 50"):
        Algebraic(exponent=1.5)
    with pytest.raises(ExperimentError, match="it has to be positive"):
        Algebraic(window=(0.1, 0.0))
    with pytest.raises(ExperimentError, match="degree is -1"):
        Algebraic(degree=-1)
    with pytest.raises(ExperimentError, match="2 numbers for 3 joints"):
        InstrumentalVariables(signals=Algebraic(window=(0.1, 0.2))).signals.windows(3)
