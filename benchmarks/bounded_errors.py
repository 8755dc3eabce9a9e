"""Set membership: in how many of a thousand draws with bounded errors the truth is inside.

python -m benchmarks.bounded_errors [DRAWS]
"""

import sys

from tests.estimation.literature.test_set_membership import outside


def main(draws: int = 1000) -> None:
    """Count and print."""
    print(f"inside in {draws - len(outside(range(draws)))} of {draws} draws")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
