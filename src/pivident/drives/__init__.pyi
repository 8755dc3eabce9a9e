from .drive_gains import DriveGains as DriveGains
from .drive_gains import identify_drive_gains as identify_drive_gains
from .known_payload import Payload as Payload
