"""Sections on filters, loop, correlations and spectra: when they appear, and what they say."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.signal_recipes import Bandpass
from pivident.judgement.report.builder import render_report
from pivident.judgement.report.frequency_figures import (
    bandpass_figure,
    decimation_figure,
    loop_figure,
    prefilter_figure,
    smoother_figure,
)
from pivident.judgement.report.sections.parameters import correlation_figure
from pivident.judgement.report.sections.residuals import spectra_figure
from pivident.judgement.validation.identified_loop import identified_loop, too_slow_smoothers
from pivident.judgement.validation.parameter_correlation import parameter_correlation
from pivident.judgement.validation.residuals.residual_spectrum import (
    residual_spectra,
    scaled_prefilters,
)
from pivident.loop.simulation.controllers import PD
from tests.judgement.report.test_report import HOSTILE, Page
from tests.planar_results import planar_results
from tests.synthetic_identification import synthetic_identification

NEW = ("correlations", "spectra", "closed-loop", "filters", "prefilters")


@pytest.fixture(scope="module")
def results():
    return planar_results("ls", "iv", "piv")


@pytest.fixture(scope="module")
def page(results):
    return render_report(results)


def section(page, anchor):
    start = page.index(f'<section id="{anchor}"')
    return page[start : page.index("</section>", start)]


def words(page, anchor):
    return " ".join(" ".join(Page(section(page, anchor)).text).split())


def test_a_full_comparison_has_all_of_them(page):
    assert set(NEW) <= set(Page(page).anchors)


def test_sections_go_with_their_material(results):
    ls, iv, _ = results
    assert {*NEW} & {*Page(render_report([ls])).anchors} == {"correlations", "spectra", "filters"}
    present = {*Page(render_report([iv])).anchors}
    assert {*NEW} & present == {*NEW} - {"prefilters"}
    loaded = replace(iv, equations=None, recordings=(), loop=None)
    assert {*NEW} & {*Page(render_report([loaded])).anchors} == {"correlations"}


def test_filters_are_shown_once_for_the_methods_that_share_them(page):
    part = section(page, "filters")
    assert part.count('class="plot"') == 3
    text = words(page, "filters")
    assert "Used by IDIM-WLS IDIM-IV" in text and "Used by IDIM-PIV" in text
    assert "every 25th sample kept (5 · 5), 1000 Hz to 40.0 Hz" in text


def test_the_loop_section_has_bandwidths_and_disagreements(page, results):
    text = words(page, "closed-loop")
    loop = identified_loop(results[-1])
    for joint in loop.joints:
        assert f"{joint.loop.noise_bandwidth:.1f} Hz" in text
        assert f"{5 * joint.bandwidth:.0f}"[:2] in text
    assert "Low-pass of the positions: 5 bandwidths are" in text
    assert "for elbow, the fastest joint; used were 50.0 Hz, clearly lower" in text
    slow = too_slow_smoothers(loop, [joint.f50 for joint in results[-1].joints], 3)
    assert f"Smoother: removes {'more' if slow else 'less'} than a thousandth" in text
    assert all(f"{name} (" in text for name, *_ in slow)


def test_filters_that_suit_the_loop_agree(results):
    iv = results[1]
    wide = Bandpass(cutoff=200.0, bandwidth=83.0)
    other = replace(iv, method_used=replace(iv.method_used, signals=wide))
    text = words(render_report([other]), "closed-loop")
    assert text.count("agrees within a factor of 1.5") == 2
    assert "clearly" not in text


def test_a_virtual_loop_gives_no_advice(results):
    virtual = replace(results[1], loop=replace(results[1].loop, reference="smoothed"))
    text = words(render_report([virtual]), "closed-loop")
    assert "The law is a virtual one" in text and "rule of thumb" not in text


def test_a_joint_without_a_loop_leaves_the_others(results):
    law = PD([0.0, 2500.0], [0.0, 60.0])
    odd = replace(results[1], loop=replace(results[1].loop, controller=law))
    text = words(render_report([odd]), "closed-loop")
    assert "the law does not keep the joint on its reference" in text
    assert "nan" not in text.lower()


def test_figures_say_in_words_what_they_show(results):
    piv = results[-1]
    joint = identified_loop(piv).joints[0]
    filters = scaled_prefilters(piv)
    figures = {
        "largest at 39.2 Hz for dq and 43.4 Hz for ddq": bandpass_figure(
            Bandpass(cutoff=50.0), ["shoulder", "elbow"], 1000.0, 0
        ),
        "-6 dB at 12.0 Hz (shoulder), 50.0 Hz (elbow)": bandpass_figure(
            Bandpass(cutoff=(12.0, 50.0)), ["shoulder", "elbow"], 1000.0, 0
        ),
        "flat to 16.0 Hz, -6 dB at 17.0 Hz": decimation_figure(Bandpass(), 1000.0, 0),
        "shoulder 87.0 Hz, elbow 12.0 Hz": smoother_figure(
            ["shoulder", "elbow"], [87.0, 12.0], 3, 1000.0, 0
        ),
        f"whitener of order {piv.joints[0].ar_order}": prefilter_figure(
            "shoulder", "N m", filters[0], 1000.0, 0
        ),
        f"bandwidth {joint.bandwidth:.5f}"[:14]: loop_figure(joint, 0),
        "outside the 95 % band": spectra_figure(residual_spectra(piv)[0], 0),
        "largest: ": correlation_figure(parameter_correlation(piv)),
    }
    for text, figure in figures.items():
        assert text in figure.label, figure.label
        assert figure.plot.data


def test_the_noise_model_of_piv_fits_its_residual(results):
    for own in residual_spectra(results[-1]):
        ratio = own.torque.density / own.model
        above = own.torque.frequency > 30.0
        assert 0.7 < np.median(ratio[above]) < 1.4
        assert own.white.outside(own.white_level) < 0.3
    assert all(own.model is None for own in residual_spectra(results[0]) if own)


def test_names_stay_text(results):
    name, (_, _, piv) = "".join(HOSTILE), results
    joints = tuple(replace(j, name=f"{name}{k}") for k, j in enumerate(piv.joints))
    own = tuple(replace(j, name=f"{name}{k}") for k, j in enumerate(piv.robot.joints))
    robot = replace(piv.robot, joints=own)
    names = (name, *piv.names[1:])
    hostile = Page(render_report([replace(piv, joints=joints, names=names, robot=robot)]))
    innocent = Page(render_report([piv]))
    for tag in ("script", "img", "b", "style"):
        assert hostile.count(tag) == innocent.count(tag)
    assert all("onerror" not in attributes for _, attributes in hostile.tags)
    assert name in "".join(hostile.text)


def test_figures_hold_no_markup(results):
    piv = results[-1]
    names = ("</script><i>", *piv.names[1:])
    text = render_report([replace(piv, names=names)])
    figures = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    assert len(figures) > 15
    assert all("<" not in figure for figure in figures)


def test_many_joints_stay_small():
    found = synthetic_identification("IDIM-PIV", "staubli_tx40", samples=20_000)
    text = render_report([found])
    added = sum(len(section(text, anchor).encode()) for anchor in ("correlations", "spectra"))
    assert added < 100_000
