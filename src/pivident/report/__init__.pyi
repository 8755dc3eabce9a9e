from .audit.audit_files import write_audit as write_audit
from .friction.friction_files import write_friction as write_friction
from .pages import write_account as write_account
