"""The example of diagnostics in axes of one's own: what it draws is what was found."""

from importlib import import_module

import numpy as np
import pytest

import pivident as pv
from tests.conftest import REPOSITORY
from tests.planar_simulations import planar_problem


def test_it_draws_what_was_found(monkeypatch, tmp_path):
    pytest.importorskip("matplotlib")
    monkeypatch.syspath_prepend(str(REPOSITORY / "examples" / "python"))
    problem = planar_problem()
    figure = import_module("own_axes").diagnostics(problem, folds=3)
    spectra, correlations, bars = figure.axes[:2], figure.axes[2:4], figure.axes[4]
    assert len(figure.axes) == 5 and all(ax.get_xscale() == "log" for ax in spectra)

    result = pv.identify(problem, "piv")
    white = result.recordings[0].whitened
    for ax, x in zip(correlations, white.T, strict=True):
        drawn = ax.get_lines()[0].get_ydata()
        known = x[np.isfinite(x)]
        first = np.sum(known[1:] * known[:-1]) / np.sum(known**2)
        assert len(drawn) > 10 and drawn[0] == pytest.approx(first, abs=0.02)
    held_out = pv.cross_validate(problem, "piv", folds=3).prediction
    heights = [bar.get_height() for bar in bars.patches]
    np.testing.assert_allclose(heights, held_out.relative, rtol=1e-6)
    figure.savefig(tmp_path / "diagnostics.png")
    assert (tmp_path / "diagnostics.png").stat().st_size > 10_000
