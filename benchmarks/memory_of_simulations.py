"""Memory of a fit of simulations over the length of the record: ML on the simulated TX40.

    python -m benchmarks.memory_of_simulations [--method ml] [--longest 552000]

Each length in a process of its own. Printed beside its peak: what the process held before, the
record included, and the difference over the bytes of the record's positions and torques.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from speed.scaling import in_child

#: Samples of the record that its scenarios have: 6.9 s at 5 kHz.
SAMPLES = 34_500


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--method", default="ml")
    parser.add_argument("--longest", type=int, default=16 * SAMPLES)
    given = parser.parse_args()
    threads = int(os.environ.get("PIVIDENT_THREADS", "2"))
    print("samples      clock   peak memory   before   more   of the record's bytes")
    samples = SAMPLES
    while samples <= given.longest:
        point = in_child(samples, threads=threads, method=given.method)
        more = point.peak_mib - point.before_mib
        print(
            f"{samples:8} {point.seconds:7.1f} s {point.peak_mib:8.0f} MiB {point.before_mib:8.0f} "
            f"{more:6.0f} {more / point.raw_mib:10.1f}",
            flush=True,
        )
        samples *= 2


if __name__ == "__main__":
    main()
