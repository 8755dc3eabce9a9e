from .bandpass import BandpassedSignal as BandpassedSignal
from .bandpass import bandpass as bandpass
from .bandpass import butterworth as butterworth
from .random_walk import SmoothedSignal as SmoothedSignal
from .random_walk import irwsm as irwsm
