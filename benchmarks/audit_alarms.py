"""How often the audit raises an alarm on clean records, and which planted delays it finds.

    python benchmarks/audit_alarms.py

Records come from the simulator with the robot's description as the truth. An alarm is any finding
that is not fine.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.audit.logs import clean_log, delayed, serious, with_channels

from pivident.audit.audit import audit_log

#: Robot, length [s] and number of records.
RECORDS = (("planar_2r", 5.0, 60), ("staubli_tx40", 4.0, 40), ("staubli_tx40", 2.0, 40))

#: Delays that are planted [s].
DELAYS = (0.0, 3e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2)


def alarms() -> None:
    """Count the records with an alarm."""
    for robot, seconds, number in RECORDS:
        kinds: Counter[str] = Counter()
        records = 0
        for seed in range(number):
            found = serious(audit_log(clean_log(robot, 100 + seed, seconds)))
            kinds.update(f"{severity} {kind}" for severity, kind, _ in found)
            records += bool(found)
        print(f"{robot}, {seconds:g} s: {records} of {number} records with an alarm {dict(kinds)}")


def delays(seeds: int = 8) -> None:
    """Median error and deviation of planted delays, and how often each was found."""
    for robot, seconds, _ in RECORDS:
        for late in DELAYS:
            errors, deviations, severities = [], [], Counter()
            for seed in range(seeds):
                log = clean_log(robot, 100 + seed, seconds)
                rate = 1.0 / float(np.median(np.diff(log.clock)))
                tau = np.column_stack([delayed(x, late * rate) for x in log.channels["tau"].T])
                audit = audit_log(with_channels(log, tau=tau))
                mean, deviation = audit.delay.common
                errors.append(abs(mean - late))
                deviations.append(deviation)
                severities[next(f.severity for f in audit.of("delay"))] += 1
            print(
                f"{robot}, {seconds:g} s, {1e3 * late:g} ms: "
                f"error {1e3 * np.median(errors):.3f} ms, "
                f"deviation {1e3 * np.median(deviations):.3f} ms, {dict(severities)}"
            )


if __name__ == "__main__":
    alarms()
    delays()
