from .audit.audit import Audit as Audit, audit_log as audit_log
from .diagnostics.diagnostics import Diagnostics as Diagnostics
from .diagnostics.verdict import Verdict as Verdict
from .model_errors.corrections import (
    Corrections as Corrections,
    corrections as corrections,
    with_corrections as with_corrections,
)
from .model_errors.named_causes import (
    ModelErrors as ModelErrors,
    NamedCause as NamedCause,
    named_causes as named_causes,
)
from .model_errors.unchecked_causes import UncheckedCause as UncheckedCause
from .report.audit_account import write_audit as write_audit
from .report.builder import write_account as write_account
from .validation.essential_parameters import (
    EssentialParameters as EssentialParameters,
    essential_parameters as essential_parameters,
)
from .validation.held_out.cross_validation import CrossValidation as CrossValidation
from .validation.held_out.replay import as_logged as as_logged
from .validation.identified_loop import (
    IdentifiedJointLoop as IdentifiedJointLoop,
    IdentifiedLoop as IdentifiedLoop,
    identified_loop as identified_loop,
)
from .validation.residuals.residual_tests import (
    ResidualTests as ResidualTests,
    residual_tests as residual_tests,
)
