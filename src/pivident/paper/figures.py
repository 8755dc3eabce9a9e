"""The figures of the paper, in its layout, from one experiment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from pivident.figures import (
    figure_of_autocorrelations,
    figure_of_bandpass,
    figure_of_control_law,
    figure_of_predictions,
    figure_of_reference,
)
from pivident.paper.claims import IV, PIV, PRINTED
from pivident.paper.experiment import Reading
from pivident.paper.published import stated

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Joints of the figures of the text, and of those of the appendix.
_FIRST, _LAST = (1, 2, 3), (4, 5, 6)

#: The joint whose identified control law figure 6 shows, and that whose reference A.9 shows.
_LAW_OF, _REFERENCE_OF = 4, 1


def paper_figures(reading: Reading) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and figure of each figure that can be drawn from an experiment.

    IDIM-PIV is the form as printed where it gave an estimate, and else the recommended one.
    """
    prefiltered = PRINTED if PRINTED in reading.results else PIV
    said = stated()
    bandpass = figure_of_bandpass(2.0 * said["nyquist"], float(said["cutoff"]))
    yield "figure_3", "Figure 3: the band-pass filters", bandpass
    pair = [form for form in (IV, prefiltered) if form in reading.results]
    for number, joints in (("4", _FIRST), ("A_7", _LAST)):
        if pair:
            made = [reading.predictions[form] for form in pair]
            caption = f"Figure {number.replace('_', '.')}: torques of the second motion"
            yield f"figure_{number}", caption, figure_of_predictions(made, joints)
    for number, joints in (("5", _FIRST), ("A_8", _LAST)):
        if pair:
            results = [reading.results[form] for form in pair]
            caption = f"Figure {number.replace('_', '.')}: autocorrelations of the residuals"
            yield f"figure_{number}", caption, figure_of_autocorrelations(results, joints)
    if reading.law is not None:
        caption = f"Figure 6: the identified control law of axis {_LAW_OF}"
        yield "figure_6", caption, figure_of_control_law(reading.law, _LAW_OF)
    caption = f"Figure A.9: the reference of axis {_REFERENCE_OF}"
    yield "figure_A_9", caption, figure_of_reference(reading.recording, _REFERENCE_OF)


#: What draws each figure of the paper.
DRAWN_BY: dict[str, Callable[..., Figure]] = {
    "3": figure_of_bandpass,
    "4": figure_of_predictions,
    "5": figure_of_autocorrelations,
    "6": figure_of_control_law,
    "A.7": figure_of_predictions,
    "A.8": figure_of_autocorrelations,
    "A.9": figure_of_reference,
}
