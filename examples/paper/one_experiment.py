"""One experiment of Brunot, Janot, Young and Carrillo (2018), beside their Table 1.

A Stäubli TX40 with the parameters of their IDIM-PIV column moves in closed loop behind encoders of
3600 points per revolution: of the motor, of the joint, or of the joint on the record only.

    python one_experiment.py [motor | joint | log]
"""

import argparse

import numpy as np

from pivident.studies import Reading, published_table, run_reading
from pivident.studies.paper.experiment import READINGS


def main(reading: str = "motor") -> Reading:
    """Run the experiment and print Table 1.

    Args:
        reading: whose revolution the points belong to.

    Returns:
        Records and results by form.
    """
    found = run_reading(reading, simulated=False, identified=False, say=print)
    forms = list(found.results)
    print("\n" + " ".join(f"{head:>12s}" for head in ("", "published", *(f[5:17] for f in forms))))
    for row in published_table():
        own = (found.results[form].value(row.name) for form in forms)
        cells = " ".join(f"{value:12.4g}" for value in (row.value["piv"], *own))
        print(f"{row.name:>12s} {cells}")
    for form, result in found.results.items():
        error = np.median(np.abs(result.theta / found.bench.expected - 1.0))
        covered = np.mean(np.abs(result.theta - found.bench.expected) < 2.0 * result.std)
        print(f"{form}: median error {100 * error:.2g} %, {100 * covered:.0f} % within 2σ")
    for form, message in found.failures.items():
        print(f"{form}: no estimate; {message}")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("reading", nargs="?", choices=list(READINGS), default="motor")
    main(**vars(parser.parse_args()))
