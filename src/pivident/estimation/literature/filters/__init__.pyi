from .online import KalmanFilter as KalmanFilter
from .recursive import RecursiveInstruments as RecursiveInstruments
from .recursive import RecursiveLeastSquares as RecursiveLeastSquares
