"""What the verdict says about motion that was not fitted."""

from __future__ import annotations

from collections.abc import Iterator

from pivident.estimation.parameter_rows import percent
from pivident.validation.examination import Examination
from pivident.validation.statement import Statement


def prediction(examination: Examination, name: str) -> Iterator[Statement]:
    """How well unseen motion is predicted."""
    compared = examination.out_of_sample
    if compared is None or name not in compared.results:
        yield Statement(
            "prediction",
            "caution",
            "Judged on the motion that was fitted only: hold blocks out, or give a second "
            "recording.",
            f"torque error {percent(100 * examination.identifications[name].relative_error)}",
        )
        return
    judged = compared.results[name]
    error, fitted = judged.prediction, judged.training
    evidence = (
        f"below {error.band:g} Hz {percent(error.total_in_band)} on {len(judged.held_out)} "
        f"held-out blocks, {percent(fitted.total_in_band)} on the fitted motion"
    )
    grows = error.total_in_band / max(fitted.total_in_band, 1e-300)
    if judged.replay is not None:
        evidence += f"; simulated loop {percent(judged.replay.total)}"
    text = f"Torque of motion that was not fitted is predicted to {percent(error.total_in_band)}"
    if grows > 1.5:
        text += f", {grows:.1f} times worse than that of the fitted motion: fewer parameters, or "
        text += "more motion"
    yield Statement("prediction", "caution" if grows > 1.5 else "good", f"{text}.", evidence)
