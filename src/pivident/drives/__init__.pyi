from .drive_gains import DriveGains as DriveGains
from .drive_gains import identify_drive_gains as identify_drive_gains
from .known_payload import Payload as Payload
from .log_units import MotorInLogUnits as MotorInLogUnits
from .log_units import identify_in_log_units as identify_in_log_units
