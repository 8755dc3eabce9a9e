"""Space that the core takes, and each extra on top of it: fresh environments, installed by pip.

python benchmarks/core_size.py [--extras report,tables]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]


def size(extra: str) -> float:
    """Space on disk of a fresh environment with the core and an extra [MB of 2²⁰ bytes]."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        wanted = f"{HERE}[{extra}]" if extra else str(HERE)
        command = [f"{folder}/bin/python", "-m", "pip", "install", "--quiet", wanted]
        subprocess.run(command, check=True)
        blocks = {
            (s.st_dev, s.st_ino): s.st_blocks for s in map(Path.lstat, Path(folder).rglob("*"))
        }
    return 512 * sum(blocks.values()) / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--extras", default="")
    options = parser.parse_args()
    core = size("")
    print(f"core: {core:.0f} MB")
    for extra in filter(None, options.extras.split(",")):
        print(f"{extra}: {size(extra) - core:.0f} MB more")


if __name__ == "__main__":
    main()
