"""Noise models of the linear subject: AR and ARMA, found in ``pivident.signals``."""

from pivident.signals.arma import Noise as Noise
from pivident.signals.arma import ar as ar
from pivident.signals.arma import arma as arma
from pivident.signals.arma import select_arma as select_arma
