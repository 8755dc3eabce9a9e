from .finding import Finding as Finding
from .finding import Quantity as Quantity
