"""Intervals of an estimate whose model is known to be wrong.

Standard errors describe noise. Where causes of model error remain, the estimate also depends on the
motion, and it is off by what correcting them would change. With σ of the noise, σ_b of the
estimates from other places and motions (a jackknife over clusters) and Δ the change by all causes,

    σ² + max(σ_b² - σ², 0) + Δ²

is the variance of each parameter; correlations stay as they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pivident.estimation.identification import Identification
from pivident.model_errors.named_causes import ModelErrors
from pivident.text.finding import Finding


def with_model_errors(found: Identification, errors: ModelErrors) -> Identification:
    """The estimate with intervals that contain the model error; itself where none matters."""
    if not errors.matter:
        return found
    std = found.std
    wider = np.sqrt(np.maximum(std, errors.between) ** 2 + errors.shift**2)
    factor = np.divide(wider, std, out=np.ones_like(std), where=std > 0.0)
    scale = np.outer(factor, factor)
    text = (
        "The intervals contain the model error that was found besides the noise "
        f"({', '.join(dict.fromkeys(named.cause.kind for named in errors.matter))})."
    )
    return replace(
        found,
        covariance=found.covariance * scale,
        robust_covariance=found.robust_covariance * scale,
        warnings=(*found.warnings, Finding("note", "intervals", "model error", text)),
    )
