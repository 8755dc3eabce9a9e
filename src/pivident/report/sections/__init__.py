"""The sections of a report, in the order of the page."""

from pivident.report.sections.base import Section
from pivident.report.sections.closed_loop import ClosedLoopSection
from pivident.report.sections.comparison import ComparisonSection
from pivident.report.sections.consistency import ConsistencySection
from pivident.report.sections.control_loop import ControlLoopSection
from pivident.report.sections.convergence import ConvergenceSection
from pivident.report.sections.correlation import CorrelationSection
from pivident.report.sections.designed_motion import DesignedMotionSection
from pivident.report.sections.downloads import DownloadsSection
from pivident.report.sections.filters import FiltersSection
from pivident.report.sections.held_out import HeldOutSection
from pivident.report.sections.joints import JointsSection
from pivident.report.sections.parameters import ParametersSection
from pivident.report.sections.prefilters import PrefiltersSection
from pivident.report.sections.provenance import ProvenanceSection
from pivident.report.sections.replay import ReplaySection
from pivident.report.sections.residuals import ResidualsSection
from pivident.report.sections.signals import SignalsSection
from pivident.report.sections.simulation import SimulationSection
from pivident.report.sections.spectra import SpectraSection
from pivident.report.sections.summary import SummarySection
from pivident.report.sections.tests import TestsSection
from pivident.report.sections.torque import TorqueSection
from pivident.report.sections.verdict import VerdictSection

SECTIONS: tuple[type[Section], ...] = (
    VerdictSection,
    SummarySection,
    ComparisonSection,
    ParametersSection,
    CorrelationSection,
    DesignedMotionSection,
    HeldOutSection,
    SimulationSection,
    ConsistencySection,
    ReplaySection,
    TorqueSection,
    JointsSection,
    ResidualsSection,
    SpectraSection,
    TestsSection,
    ControlLoopSection,
    ClosedLoopSection,
    FiltersSection,
    PrefiltersSection,
    ConvergenceSection,
    SignalsSection,
    DownloadsSection,
    ProvenanceSection,
)
