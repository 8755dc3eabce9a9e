from .arm_and_load import KnownParts as KnownParts
from .identify_payload import identify_payload as identify_payload
from .load_estimate import LoadEstimate as LoadEstimate
from .payload_identification import PayloadIdentification as PayloadIdentification
