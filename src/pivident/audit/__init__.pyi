from .audit import Audit as Audit
from .audit import audit_file as audit_file
from .audit import audit_log as audit_log
from .described_reading import described_log as described_log
from .log import Log as Log
from .reading import bare_log as bare_log
