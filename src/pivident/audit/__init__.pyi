from .audit import Audit as Audit
from .audit import audit_log as audit_log
from .audit_file import audit_file as audit_file
