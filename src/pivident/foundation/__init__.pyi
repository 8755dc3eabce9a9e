from .text.finding import Finding as Finding
from .text.finding import Quantity as Quantity
