from .load import recording_from as recording_from
from .measured_wrenches import with_wrenches as with_wrenches
from .public_records import load_emps as load_emps
from .public_records import load_emps_pulses as load_emps_pulses
from .public_records import load_kuka_kr300 as load_kuka_kr300
from .public_records import load_staubli_tx40 as load_staubli_tx40
