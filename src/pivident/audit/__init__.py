"""The audit of a log: what is wrong with it, before anything is identified from it."""

from pivident.audit.audit import Audit as Audit
from pivident.audit.audit import audit_log as audit_log
from pivident.audit.audit import write_audit as write_audit
from pivident.audit.audit_file import audit_file as audit_file
from pivident.audit.finding import Finding as Finding
from pivident.logs.bare_log import bare_log as bare_log
from pivident.logs.described_log import described_log as described_log
from pivident.logs.log import Log as Log
