"""The load that a robot carries, from a record without and one with it.

`identify_payload` does the work; `LoadEstimate` holds mass, centre of mass and inertia with their
intervals.
"""

from pivident.payload.identify_payload import PayloadIdentification, identify_payload
from pivident.payload.known_parts import KnownParts
from pivident.payload.load_estimate import LoadEstimate

__all__ = ["KnownParts", "LoadEstimate", "PayloadIdentification", "identify_payload"]
