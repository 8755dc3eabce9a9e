from .estimates import (
    figure_of_convergence as figure_of_convergence,
    figure_of_correlations as figure_of_correlations,
    figure_of_friction as figure_of_friction,
    figure_of_intervals as figure_of_intervals,
)
from .filters import (
    figure_of_bandpass as figure_of_bandpass,
    figure_of_prefilters as figure_of_prefilters,
)
from .paper_style import FigureError as FigureError, save_figure as save_figure
from .residuals import (
    figure_of_autocorrelations as figure_of_autocorrelations,
    figure_of_residual_spectra as figure_of_residual_spectra,
)
from .torques import (
    figure_of_control_law as figure_of_control_law,
    figure_of_predictions as figure_of_predictions,
    figure_of_torques as figure_of_torques,
)
from .tracking import (
    figure_of_reference as figure_of_reference,
    figure_of_tracking as figure_of_tracking,
)
