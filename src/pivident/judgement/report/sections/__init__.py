"""The sections of a report, in the order of the page."""

from pivident.judgement.report.sections.base import Section
from pivident.judgement.report.sections.consistency import ConsistencySection
from pivident.judgement.report.sections.control_loop import ClosedLoopSection, ControlLoopSection
from pivident.judgement.report.sections.convergence import ConvergenceSection, PrefiltersSection
from pivident.judgement.report.sections.filters import FiltersSection
from pivident.judgement.report.sections.held_out import HeldOutSection
from pivident.judgement.report.sections.motion import (
    DesignedMotionSection,
    ReplaySection,
    SignalsSection,
    TorqueSection,
)
from pivident.judgement.report.sections.parameters import (
    ComparisonSection,
    CorrelationSection,
    JointsSection,
    ParametersSection,
)
from pivident.judgement.report.sections.provenance import DownloadsSection, ProvenanceSection
from pivident.judgement.report.sections.residuals import (
    ResidualsSection,
    SpectraSection,
    TestsSection,
)
from pivident.judgement.report.sections.simulation import SimulationSection
from pivident.judgement.report.sections.verdict import SummarySection, VerdictSection

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
