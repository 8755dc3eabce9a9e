"""The sections of a report, in the order of the page."""

from collections.abc import Iterator

from pivident.judgement.report.report_data import ReportData
from pivident.judgement.report.sections.base import Section
from pivident.judgement.report.sections.consistency import ConsistencySection
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
from pivident.judgement.report.sections.verdict import SummarySection, VerdictSection

#: Sections before those of simulations, between these and those of loops, and behind them.
BEFORE_SIMULATIONS: tuple[type[Section], ...] = (
    VerdictSection,
    SummarySection,
    ComparisonSection,
    ParametersSection,
    CorrelationSection,
    DesignedMotionSection,
    HeldOutSection,
)
BEFORE_LOOPS: tuple[type[Section], ...] = (
    ConsistencySection,
    ReplaySection,
    TorqueSection,
    JointsSection,
    ResidualsSection,
    SpectraSection,
    TestsSection,
)
BEHIND_LOOPS: tuple[type[Section], ...] = (
    FiltersSection,
    PrefiltersSection,
    ConvergenceSection,
    SignalsSection,
    DownloadsSection,
    ProvenanceSection,
)


def sections_of(data: ReportData) -> Iterator[type[Section]]:
    """Sections of these results; those of simulations and loops are imported where some are."""
    yield from BEFORE_SIMULATIONS
    if any(i.simulation is not None for i in data.identifications):
        from pivident.judgement.report.sections.simulation import SimulationSection

        yield SimulationSection
    yield from BEFORE_LOOPS
    if any(i.loop is not None for i in data.identifications):
        from pivident.judgement.report.sections.control_loop import (
            ClosedLoopSection,
            ControlLoopSection,
        )

        yield from (ControlLoopSection, ClosedLoopSection)
    yield from BEHIND_LOOPS
