from .bandpass import (
    BandpassedSignal as BandpassedSignal,
    bandpass as bandpass,
    butterworth as butterworth,
)
from .random_walk import SmoothedSignal as SmoothedSignal, irwsm as irwsm
