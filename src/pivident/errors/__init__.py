"""Errors of pivident: one base class, children that keep their evidence.

Every message names the object (joint, sample, file, key), the value met, the value expected
and the next step, so that it can be shown to a user as one readable line.
"""

from pivident.errors.identifications import (
    ContradictoryBounds,
    DelayTooLong,
    MassMatrixNotPositiveDefinite,
    NegativePayload,
    NoConsistentModelNear,
    OrdersNotSupported,
    RankDeficientRegressor,
    SimulationDiverged,
    UnstableFit,
    UnusableSignal,
)
from pivident.errors.kinds import (
    ExperimentError,
    ExportError,
    FileFormatError,
    IdentificationError,
    IdentificationFileError,
    PividentError,
    RecordingError,
    RobotDescriptionError,
)
from pivident.errors.recordings import (
    BadCell,
    ChecksumMismatch,
    ClocksDisagree,
    ConstantChannel,
    DatasetUnavailable,
    GapInClock,
    IrregularSampling,
    MissingSamples,
    NonFiniteSamples,
    PositionsBeyondLimits,
    RecordingTooShort,
    SaturatedSignal,
    ShapeMismatch,
    UnknownColumn,
)

__all__ = [
    "BadCell",
    "ChecksumMismatch",
    "ClocksDisagree",
    "ConstantChannel",
    "ContradictoryBounds",
    "DatasetUnavailable",
    "DelayTooLong",
    "ExperimentError",
    "ExportError",
    "FileFormatError",
    "GapInClock",
    "IdentificationError",
    "IdentificationFileError",
    "IrregularSampling",
    "MassMatrixNotPositiveDefinite",
    "MissingSamples",
    "NegativePayload",
    "NoConsistentModelNear",
    "NonFiniteSamples",
    "OrdersNotSupported",
    "PividentError",
    "PositionsBeyondLimits",
    "RankDeficientRegressor",
    "RecordingError",
    "RecordingTooShort",
    "RobotDescriptionError",
    "SaturatedSignal",
    "ShapeMismatch",
    "SimulationDiverged",
    "UnknownColumn",
    "UnstableFit",
    "UnusableSignal",
]
