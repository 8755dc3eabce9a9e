"""The load that a robot carries, from a record without and one with the load.

`identify_payload` does the work; `LoadEstimate` holds mass, centre of mass and inertia with their
intervals.
"""

from pivident.payload.identify_payload import identify_payload
from pivident.payload.known_parts import KnownParts
from pivident.payload.load_estimate import LoadEstimate
from pivident.payload.payload_identification import PayloadIdentification

__all__ = ["KnownParts", "LoadEstimate", "PayloadIdentification", "identify_payload"]
