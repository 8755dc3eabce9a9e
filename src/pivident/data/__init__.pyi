from .logs.described_log import bare_log as bare_log, described_log as described_log
from .logs.log import Log as Log
from .logs.read_log import read_log as read_log
from .recording.load import recording_from as recording_from
from .recording.measured_wrenches import with_wrenches as with_wrenches
from .recording.public_records import (
    load_emps as load_emps,
    load_emps_pulses as load_emps_pulses,
    load_kuka_kr300 as load_kuka_kr300,
    load_staubli_tx40 as load_staubli_tx40,
)
