from .described_log import bare_log as bare_log
from .described_log import described_log as described_log
from .log import Log as Log
from .read_log import read_log as read_log
