"""Where the time of an IDIM-PIV goes, what bounds each stage, and how far it is from that bound.

    PIVIDENT_DATA=FOLDER python benchmarks/profile_piv.py [--repeats 9]

Stages are timed by the processor time of the threads that do them, with one thread at a time
(``PIVIDENT_THREADS=1``): it does not depend on what else the machine does, and the sum over the
stages is the work of one identification. Beside it stand the operations and the bytes of each
stage, counted from its shapes, and what this processor can do: arithmetic from independent
multiply-adds in registers, memory bandwidth from STREAM's triad, latency from a chain of
multiply-adds that wait for each other. ``docs/speed.md`` explains the table.
"""

from __future__ import annotations

import argparse
import os

os.environ["PIVIDENT_THREADS"] = "1"  # before pivident asks
for _library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

from speed import bounds, plots, stages  # noqa: E402
from speed.report import RESULTS, write_json  # noqa: E402
from speed.timing import load  # noqa: E402
from speed.workloads import whole_job  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    label, problem = whole_job()
    ceilings = bounds.measure()
    profile = stages.profile(problem, options.repeats)
    table = stages.against(profile, problem, ceilings)
    print(f"{label}, {profile.iterations} iterations; load {load():.1f}")
    print(
        f"one thread: {ceilings.multiply_adds / 1e9:.1f} G multiply-adds/s, triad "
        f"{ceilings.bandwidth / 1e9:.1f} GB/s, chain {1e9 * ceilings.latency:.2f} ns a link"
    )
    print(f"{'stage':42s} {'ms':>7s} {'share':>6s} {'bound':>8s} {'floor ms':>8s} {'times':>6s}")
    for row in table:
        floor = f"{row.floor_ms:8.1f} {row.distance:6.1f}" if row.bound else ""
        print(f"{row.stage:42s} {row.ms:7.1f} {100 * row.share:5.1f}% {row.bound:>8s} {floor}")
    plots.stages(table, RESULTS)
    write_json("profile", {"work": label, "bounds": ceilings, "stages": table})


if __name__ == "__main__":
    main()
