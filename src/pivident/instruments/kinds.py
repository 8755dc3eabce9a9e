"""All kinds of instruments by name, those first that cure most."""

from __future__ import annotations

from pivident.instruments.given_motion import LOOP, InstrumentKind
from pivident.instruments.interleaved_halves import HALVES
from pivident.instruments.reference_response import RESPONSE, VIRTUAL
from pivident.instruments.repeated_motion import REPETITION
from pivident.instruments.second_sensor import SENSOR

#: Those that share nothing with the noise of the record, then those that share some of it.
KINDS: dict[str, InstrumentKind] = {
    kind.name: kind for kind in (LOOP, RESPONSE, REPETITION, SENSOR, VIRTUAL, HALVES)
}
