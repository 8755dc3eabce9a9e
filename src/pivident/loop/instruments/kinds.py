"""All kinds of instruments by name, those first that cure most."""

from __future__ import annotations

from pivident.loop.instruments.given_motion import LOOP, InstrumentKind
from pivident.loop.instruments.interleaved_halves import HALVES
from pivident.loop.instruments.reference_response import RESPONSE, VIRTUAL
from pivident.loop.instruments.repeated_motion import REPETITION
from pivident.loop.instruments.second_sensor import SENSOR

#: Those that share nothing with the noise of the record, then those that share some of it.
KINDS: dict[str, InstrumentKind] = {
    kind.name: kind for kind in (LOOP, RESPONSE, REPETITION, SENSOR, VIRTUAL, HALVES)
}
