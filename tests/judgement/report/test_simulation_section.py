"""The page about fitted simulations: errors, unknowns of the loop, and sentences of other parts."""

import re
from functools import cache

import numpy as np
import pytest

from pivident.estimation.output_error.thinning import means_at
from pivident.judgement.report.builder import render_report
from pivident.judgement.report.sections.simulation import simulation_figure, thinned_errors
from pivident.loop.simulation.closed_loop import simulate
from tests.browser import needs_browser, seen_on_a_phone
from tests.planar_simulations import simulated_diagnostics, simulated_results


@cache
def page() -> str:
    diagnostics = simulated_diagnostics()
    return render_report(list(diagnostics.identifications.values()), diagnostics=diagnostics)


def section(anchor: str, text: str | None = None) -> str:
    """Words of one part of the page."""
    found = re.search(rf'<section id="{anchor}".*?</section>', text or page(), re.DOTALL)
    assert found, anchor
    words = re.sub(r"<script.*?</script>|<[^>]+>", " ", found.group(0), flags=re.DOTALL)
    return " ".join(words.split())


def test_section_has_errors_and_loop_parameters_of_each_method():
    text = section("simulation")
    for method in ("CLOE", "ML", "OLOE"):
        assert method in text
    assert "driven by the recorded torques" in text and "IDIM-PIV" not in text
    assert re.search(r"kp1 \d{4}\.\d+ \d", text) and "output/rad" in text
    assert "without noise models" in text  # the open loop
    assert "Autocorrelation (Ljung-Box)" in text


def test_there_is_no_section_without_such_methods():
    assert 'id="simulation"' not in render_report([simulated_results()["piv"]])


@pytest.mark.parametrize("name", ["cloe", "ml", "oloe"])
def test_drawn_errors_are_measured_less_simulated(name):
    """Simulated anew where the estimate is; noise moves the mean near reversals only."""
    result = simulated_results()[name]
    fit = result.simulation.fit
    (own,) = thinned_errors(fit)
    errors = []
    for stretch, factor in zip(fit.stretches, fit.factors, strict=True):
        loop = stretch.loop
        made = simulate(loop.model, loop.controller, loop.signals, ("a", "b"), loop.begin)
        q = made.q[:: stretch.step][: stretch.samples]
        errors += [means_at(stretch.q - q, factor), np.full((1, 2), np.nan)]
    by_hand = np.concatenate(errors)[:-1]
    drawn = own.errors[0]
    both = np.isfinite(drawn) & np.isfinite(by_hand)
    assert both.mean() > 0.8 and (np.diff(own.t) > 0.0).all()
    spread = np.std(by_hand[both])
    assert np.median(np.abs(drawn[both] - by_hand[both])) < 0.05 * spread
    figure = simulation_figure(result, own, 1, 2, 500)
    assert figure.title == "elbow" and "rms error" in figure.note and "rad" in figure.note
    assert len(figure.plot.data) == (4 if name == "ml" else 3)


def test_other_parts_read_rightly():
    assert "Weighted simulation error" in section("convergence")
    assert "Steps taken back" in section("convergence")
    prefilters = re.search(r'<section id="prefilters".*?</section>', page(), re.DOTALL).group(0)
    assert "whitener of order" in prefilters and "CLOE" not in prefilters
    for anchor in ("residuals", "tests", "spectra", "joints"):
        assert "was not fitted" in section(anchor) or "torque errors on the measured" in section(
            anchor
        )
    assert "no filter has touched" in section("filters")
    held_out = section("held-out")
    assert "Rms error of the simulated positions" in held_out and "in open loop" in held_out
    assert "delay, kp" in section("provenance")


def test_parts_of_other_methods_say_nothing_of_simulations():
    text = render_report([simulated_results()["piv"]])
    for anchor in ("residuals", "tests", "spectra", "joints", "filters"):
        assert "was not fitted" not in section(anchor, text)


@needs_browser
def test_page_fits_a_phone(tmp_path):
    """Figures of other sections are drawn in test_figure_tools."""
    seen = seen_on_a_phone(page(), tmp_path, part="#simulation")
    assert seen["plots"] == seen["drawn"] == 6
