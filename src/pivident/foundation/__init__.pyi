from .text.finding import Finding as Finding, Quantity as Quantity
