from .identify_payload import identify_payload as identify_payload
from .known_parts import KnownParts as KnownParts
from .load_estimate import LoadEstimate as LoadEstimate
from .payload_identification import PayloadIdentification as PayloadIdentification
