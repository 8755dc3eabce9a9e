"""Figures: what they draw is what was found, they are labelled, and they can be printed."""

import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import pivident as pv
from pivident import studies as figures
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import PividentError
from pivident.judgement.validation.residuals.autocorrelation import autocorrelation, joint_residuals
from pivident.judgement.validation.residuals.residual_spectrum import (
    residual_spectra,
    welch_spectrum,
)
from pivident.studies.figures.paper_style import LINES, STYLE, WIDTHS
from tests.planar_log import write_experiment
from tests.synthetic_identification import synthetic_identification

matplotlib = pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def result():
    return synthetic_identification(samples=8000)


def axes_of(figure):
    return [ax for ax in figure.axes if ax.get_visible()]


def test_every_figure_has_its_size_and_units(result):
    before = dict(matplotlib.rcParams)
    ls = synthetic_identification("IDIM-LS", seed=8)
    for columns, width in WIDTHS.items():
        made = [
            figures.figure_of_torques(result, columns=columns),
            figures.figure_of_tracking(result, columns=columns),
            figures.figure_of_residual_spectra(result, columns=columns),
            figures.figure_of_friction([ls, result], columns=columns),
            figures.figure_of_convergence(result, columns=columns),
        ]
        for figure in made:
            assert figure.get_figwidth() == width and figure.get_figheight() < 9.3
            for ax in axes_of(figure):
                label = ax.get_ylabel()
                assert re.search(r"\[.+\]$", label) or label == "power / white"
                assert ax.get_xlabel() or ax.get_title()
    assert dict(matplotlib.rcParams) == before, "the caller's settings come back"


def test_torques_are_drawn_as_they_are(result):
    figure = figures.figure_of_torques(result, ["elbow"], columns=1)
    (ax,) = axes_of(figure)
    measured, model, error = ax.get_lines()
    record = result.recordings[0]
    assert np.isin(model.get_ydata(), record.tau_model[:, 1]).all()
    assert np.isin(model.get_xdata(), record.t - record.t[0]).all() and model.get_xdata().size > 500
    assert model.get_ydata().min() == record.tau_model[:, 1].min()
    assert measured.get_ydata().max() == record.tau[:, 1].max()
    assert error.get_ydata().max() == (record.tau - record.tau_model)[:, 1].max()
    assert "elbow" in ax.get_title() and ax.get_ylabel() == "torque [N m]"


def test_autocorrelations_are_those_of_the_report(result):
    figure = figures.figure_of_autocorrelations([result, result], ["elbow"], lags=20)
    left, right = axes_of(figure)
    found = autocorrelation(joint_residuals(result)[1], 20)
    points, upper, lower = left.get_lines()
    np.testing.assert_array_equal(points.get_ydata(), found.rho)
    np.testing.assert_array_equal(upper.get_ydata(), found.band)
    np.testing.assert_array_equal(lower.get_ydata(), -found.band)
    assert right.get_title() == result.method and not right.get_ylabel()
    with pytest.raises(figures.FigureError, match="give at least one"):
        figures.figure_of_autocorrelations([])


def test_predictions_are_drawn_as_they_are(result):
    record = result.recordings[0]
    log = pv.Recording.from_arrays(
        record.q_measured, record.tau, record.whitened_rate, joint_names=result.robot.joint_names
    )
    own = pv.predict(result, log)
    figure = figures.figure_of_predictions([own, own], [2], columns=2)
    left, _ = axes_of(figure)
    measured, predicted, error = left.get_lines()
    part = own.moving
    assert measured.get_ydata().max() == own.tau[part, 1].max()
    assert predicted.get_ydata().min() == own.tau_model[part, 1].min()
    assert error.get_ydata().max() == (own.tau - own.tau_model)[part, 1].max()
    assert left.get_ylabel() == "elbow [N m]"
    with pytest.raises(figures.FigureError, match="no torques to compare with"):
        figures.figure_of_predictions(replace(own, tau=None))


def test_the_bandpass_is_a_derivative_below_its_cutoff():
    gain, phase = axes_of(figures.figure_of_bandpass(2000.0, 50.0))
    curves = {line.get_label(): line for line in gain.get_lines()}
    frequency = curves["band-pass"].get_xdata()
    low = frequency < 20.0
    apart = curves["band-pass"].get_ydata() - curves["derivative"].get_ydata()
    assert np.abs(apart[low]).max() < 0.1
    at = np.argmin(np.abs(frequency - 50.0))
    assert curves["low-pass, both ways"].get_ydata()[at] == pytest.approx(-6.02, abs=0.2)
    assert all(set(np.round(line.get_ydata())) <= {0.0, 90.0} for line in phase.get_lines())


def test_reference_and_control_law(result):
    record = result.recordings[0]
    log = pv.Recording.from_arrays(
        record.q_measured,
        record.tau,
        500.0,
        joint_names=result.robot.joint_names,
        q_ref=record.q_measured,
        dq_ref=2.0 * record.dq,
    )
    axes = axes_of(figures.figure_of_reference(log, "elbow"))
    assert [ax.get_ylabel() for ax in axes] == [
        "position [rad]", "speed [rad/s]", "acceleration [rad/s²]",
    ]  # fmt: skip
    assert axes[1].get_lines()[0].get_ydata().max() == 2.0 * record.dq[:, 1].max()
    speed = np.gradient(2.0 * record.dq[:, 1], 1.0 / 500.0)
    assert axes[2].get_lines()[0].get_ydata().max() == speed.max()
    with pytest.raises(figures.FigureError, match="has no reference"):
        figures.figure_of_reference(replace(log, q_ref=None, dq_ref=None), 1)
    output = np.outer(np.arange(1.0, 101.0), [1.0, 2.0])
    law = SimpleNamespace(
        output=output, model=0.9 * output, rate=100.0, joint_names=("shoulder", "elbow")
    )
    above, below = axes_of(figures.figure_of_control_law(law, 2))
    assert above.get_title() == "elbow: 10.0 % left unexplained"
    np.testing.assert_allclose(below.get_lines()[0].get_ydata(), 0.1 * output[:, 1])


def test_intervals_say_their_numbers(result):
    figure = figures.figure_of_intervals(result, ["fv1", "zz1r"])
    names = [t.get_text() for t in figure.axes[0].get_yticklabels()]
    texts = [t.get_text() for t in figure.axes[1].get_yticklabels()]
    assert names == ["fv1", "zz1r"]
    assert re.fullmatch(r"2\.\d+ ± 0\.\d+ N m s/rad", texts[0])
    both = figures.figure_of_intervals([result, result], labels=["a", "b"], truth={"fv1": 2.5})
    assert len(both.axes[0].get_yticklabels()) == 13


def test_spectra_are_those_of_the_report(result):
    (ax,) = axes_of(figures.figure_of_residual_spectra(result, ["elbow"], columns=1))
    own = residual_spectra(result)[1].white
    (line,), (band,) = ax.get_lines(), ax.collections
    rate = result.recordings[0].whitened_rate
    np.testing.assert_array_equal(line.get_xdata(), own.frequency)
    np.testing.assert_allclose(line.get_ydata(), own.density * rate / 2.0)
    low, high = own.band(1.0)
    edges = band.get_paths()[0].vertices[:, 1]
    assert edges.min() == low.min() and edges.max() == high.max()
    assert line.get_ydata().mean() == pytest.approx(
        np.nanvar(result.recordings[0].whitened[:, 1]), rel=0.2
    )


def test_white_noise_stays_in_its_band_and_coloured_noise_does_not():
    from scipy.signal import lfilter

    rng = np.random.default_rng(2)
    white = rng.standard_normal(200_000)
    white[50_000:50_400] = np.nan
    found = welch_spectrum([white], 1000.0)
    assert found.outside(2.0 / 1000.0) < 0.12
    assert found.density.mean() == pytest.approx(2.0 / 1000.0, rel=0.05)
    coloured = lfilter([1.0], [1.0, -0.9], rng.standard_normal(200_000))
    found = welch_spectrum([coloured], 1000.0)
    turn = np.exp(-2j * np.pi * found.frequency / 1000.0)
    model = 2.0 / 1000.0 / np.abs(1.0 - 0.9 * turn) ** 2
    assert np.median(found.density / model) == pytest.approx(1.0, abs=0.05)
    assert found.outside(2.0 / 1000.0) > 0.5
    assert welch_spectrum([white[:100]], 1000.0) is None


def test_prefilters_and_correlations_of_a_real_estimate(tmp_path):
    write_experiment(tmp_path)
    problem = load_experiment(next(tmp_path.glob("*.toml"))).problem()
    piv = pv.identify(problem, "piv")
    (ax,) = figures.figure_of_prefilters(piv).axes
    line = ax.get_lines()[0]
    own = piv.equations.filters[0]
    f = line.get_xdata()[-1]
    z = np.exp(2j * np.pi * np.array([line.get_xdata()[0], f]) / 1000.0)
    polynomials = [np.asarray(p, dtype=float) for p in (own.numerator, own.denominator, own.fir)]
    n, d, a = (sum(c * z**-k for k, c in enumerate(p)) for p in polynomials)
    gain = np.abs(n * a / d)
    assert line.get_ydata()[-1] == pytest.approx(20 * np.log10(gain[1] / gain[0]))
    image = figures.figure_of_correlations(piv).axes[0].get_images()[0].get_array()
    np.testing.assert_allclose(np.diag(image), 1.0)
    std = piv.method_std
    np.testing.assert_allclose(image[0, 1] * std[0] * std[1], piv.covariance[0, 1])


def test_files_have_their_fonts_and_no_date(result, tmp_path):
    figure = figures.figure_of_convergence(result)
    names = ("a.pdf", "a.svg", "a.png")
    paths = figures.save_figure(figure, *(tmp_path / name for name in names))
    pdf = paths[0].read_bytes()
    assert pdf.startswith(b"%PDF") and b"/FontFile2" in pdf and b"/CreationDate" not in pdf
    svg = paths[1].read_text("utf-8")
    assert "<svg" in svg and "<text" not in svg, "text is drawn as outlines"
    assert paths[2].read_bytes()[1:4] == b"PNG"
    with pytest.raises(PividentError, match=r"\.pdf"):
        figures.save_figure(figure, tmp_path / "a.docx")


def test_lines_can_be_told_apart_in_grey():
    def lightness(colour):
        r, g, b = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
        return 0.2126 * r + 0.7152 * g + 0.0722 * b

    first = [lightness(line["color"]) for line in LINES[:3]]
    assert min(abs(a - b) for a in first for b in first if a != b) > 0.15
    assert len({str(line["linestyle"]) for line in LINES}) == len(LINES)
    assert len({line["marker"] for line in LINES}) == len(LINES)
    assert STYLE["pdf.fonttype"] == 42


def test_names_are_text_and_not_mathematics(result, tmp_path):
    hostile = r"$\frac{1}{$ \x1b[31m"
    robot = result.robot
    joints = (replace(robot.joints[0], name=r"$\frac{$"), robot.joints[1])
    fits = (replace(result.joints[0], name=r"$\frac{$"), result.joints[1])
    odd = replace(result, robot=replace(robot, joints=joints), joints=fits)
    figures.save_figure(figures.figure_of_torques(odd, columns=1), tmp_path / "a.png")
    both = figures.figure_of_intervals([odd, odd], ["fv1"], labels=[hostile, "b"])
    figures.save_figure(both, tmp_path / "b.png")


def test_what_cannot_be_drawn_is_said(result, tmp_path):
    result.save(tmp_path)
    loaded = pv.load_identification(tmp_path)
    for draw in (figures.figure_of_torques, figures.figure_of_tracking):
        with pytest.raises(PividentError, match="no signals"):
            draw(loaded)
    with pytest.raises(PividentError, match="no equations"):
        figures.figure_of_prefilters(result)
    with pytest.raises(PividentError, match="one step"):
        figures.figure_of_convergence(synthetic_identification("IDIM-LS"))
    with pytest.raises(PividentError, match="elbow"):
        figures.figure_of_torques(result, ["elbo"])
    with pytest.raises(PividentError, match="1 or 2 columns"):
        figures.figure_of_torques(result, columns=3)
    with pytest.raises(PividentError, match="fv1"):
        figures.figure_of_intervals(result, ["fv11"])
    for draw in (figures.figure_of_friction, figures.figure_of_intervals):
        assert draw(loaded).axes
    assert figures.figure_of_correlations(loaded).axes


def test_nothing_heavy_before_it_is_needed_and_no_window():
    code = (
        "import sys, pivident.studies.figures, pivident.studies.tables; "
        "print([m for m in ('matplotlib', 'numba', 'pandas', 'polars') if m in sys.modules]); "
        "from pivident.studies.figures.paper_style import new_figure; new_figure(1); "
        "print('matplotlib.pyplot' in sys.modules)"
    )
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert said.stdout.split("\n")[:2] == ["[]", "False"]


def test_every_figure_is_drawn_into_axes_of_the_caller(result):
    """One panel each, or several: nothing is made but what was asked for, in the caller's style."""
    ls = synthetic_identification("IDIM-LS", seed=8)
    (recording,) = result.recordings
    run = pv.Recording("run", ("a", "b"), recording.q, recording.tau, 1000.0, q_ref=recording.q)
    drawn = {
        2: [
            lambda ax: figures.figure_of_torques(result, ax=ax),
            lambda ax: figures.figure_of_residual_spectra(result, ax=ax),
            lambda ax: figures.figure_of_friction([ls, result], ax=ax),
            lambda ax: figures.figure_of_convergence(result, ax=ax),
            lambda ax: figures.figure_of_bandpass(1000.0, 20.0, ax=ax),
            lambda ax: figures.figure_of_tracking(result, ["elbow"], ax=ax),
            lambda ax: figures.figure_of_autocorrelations(result, ax=ax),
        ],
        1: [
            lambda ax: figures.figure_of_torques(result, ["elbow"], ax=ax),
            lambda ax: figures.figure_of_intervals([ls, result], ax=ax),
            lambda ax: figures.figure_of_correlations(result, ax=ax),
        ],
        3: [lambda ax: figures.figure_of_reference(run, "a", ax=ax)],
    }
    with matplotlib.rc_context({"font.size": 13.0}):
        for count, draw in ((n, each) for n, several in drawn.items() for each in several):
            own = matplotlib.figure.Figure()
            axes = own.subplots(count)
            assert draw(axes) is own
            given = list(np.ravel(axes))
            assert all(ax.has_data() for ax in given) and not own.legends
            assert not any(ax in given for ax in own.axes[count:])  # a scale or a second side
            assert given[0].title.get_fontsize() > 12.0
    with pytest.raises(PividentError, match=r"1 axes are given for 2 panels; .*subplots\(2\)"):
        figures.figure_of_torques(result, ax=matplotlib.figure.Figure().subplots())
    with pytest.raises(PividentError, match="for 1 panel;"):
        figures.figure_of_torques(result, ["elbow"], ax="axes")
