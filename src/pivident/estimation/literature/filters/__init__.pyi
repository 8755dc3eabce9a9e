from .online import KalmanFilter as KalmanFilter
from .recursive import (
    RecursiveInstruments as RecursiveInstruments,
    RecursiveLeastSquares as RecursiveLeastSquares,
)
