"""The sections of a report, in the order of the page."""

from pivident.report.sections.base import Section
from pivident.report.sections.consistency import ConsistencySection
from pivident.report.sections.control_loop import ClosedLoopSection, ControlLoopSection
from pivident.report.sections.convergence import ConvergenceSection, PrefiltersSection
from pivident.report.sections.filters import FiltersSection
from pivident.report.sections.held_out import HeldOutSection
from pivident.report.sections.motion import (
    DesignedMotionSection,
    ReplaySection,
    SignalsSection,
    TorqueSection,
)
from pivident.report.sections.parameters import (
    ComparisonSection,
    CorrelationSection,
    JointsSection,
    ParametersSection,
)
from pivident.report.sections.provenance import DownloadsSection, ProvenanceSection
from pivident.report.sections.residuals import ResidualsSection, SpectraSection, TestsSection
from pivident.report.sections.simulation import SimulationSection
from pivident.report.sections.verdict import SummarySection, VerdictSection

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
