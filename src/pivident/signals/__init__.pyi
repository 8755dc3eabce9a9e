from .bandpass import BandpassedSignal as BandpassedSignal
from .bandpass import bandpass as bandpass
from .bandpass import butterworth as butterworth
