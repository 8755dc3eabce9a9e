from .arx import arx as arx
from .conversion import from_control as from_control, from_scipy as from_scipy
from .estimate import LinearEstimate as LinearEstimate
from .free_law import identify_free_law as identify_free_law
from .model import Noise as Noise, ar as ar, arma as arma, select_arma as select_arma
from .order_selection import select_orders as select_orders
from .sriv import riv as riv, sriv as sriv
from .srivc import rivc as rivc, srivc as srivc
