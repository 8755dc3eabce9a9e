"""How sure it is what a column, a clock or a unit was taken for."""

from typing import Literal

#: ``certain``: the log or the robot says so. ``likely``: all that was seen agrees. ``assumed``:
#: something else is possible.
Sureness = Literal["certain", "likely", "assumed"]
