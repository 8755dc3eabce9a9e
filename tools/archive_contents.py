"""Refuse a wheel or a source archive that lacks files or holds files that do not belong in it.

``python tools/archive_contents.py dist/*.whl dist/*.tar.gz``
"""

from __future__ import annotations

import sys
import tarfile
import zipfile
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]

#: Beside the sources, a source archive may hold these.
ALLOWED = {
    "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE", "Makefile",
    "pyproject.toml", "PKG-INFO", ".gitignore", "src", "tests", "docs", "examples", "benchmarks",
    "tools", ".ci",
}  # fmt: skip


def package_files(root: Path) -> set[str]:
    """Files of the package in the working tree, without caches."""
    source = root / "src"
    return {
        path.relative_to(source).as_posix()
        for path in (source / "pivident").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".pyc"
    }


def wheel_faults(names: set[str], expected: set[str]) -> list[str]:
    """What is wrong with the files of a wheel."""
    package = {name for name in names if ".dist-info/" not in name}
    faults = [f"the wheel lacks {name}" for name in sorted(expected - package)]
    faults += [f"the wheel holds {name}" for name in sorted(package - expected)]
    about = {name.rsplit("/", 1)[1] for name in names - package if not name.endswith("/")}
    faults += [f"no {n} in .dist-info" for n in ("METADATA", "LICENSE", "entry_points.txt")
               if n not in about]  # fmt: skip
    return faults


def source_faults(names: set[str], expected: set[str]) -> list[str]:
    """What is wrong with the files of a source archive."""
    inside = {name.split("/", 1)[1] for name in names if "/" in name}
    faults = [f"the source archive lacks src/{n}" for n in sorted(expected)
              if f"src/{n}" not in inside]  # fmt: skip
    strange = {name.split("/", 1)[0] for name in inside} - ALLOWED
    faults += [f"the source archive holds {name}" for name in sorted(strange)]
    faults += [f"the source archive holds {n}" for n in sorted(inside) if n.endswith(".pyc")]
    return faults


def main(archives: list[str]) -> int:
    """Check the archives; 1 where something is wrong."""
    expected = package_files(REPOSITORY)
    faults = []
    for archive in archives:
        if archive.endswith(".whl"):
            with zipfile.ZipFile(archive) as wheel:
                names = set(wheel.namelist())
            faults += wheel_faults(names, expected)
        else:
            with tarfile.open(archive) as source:
                names = {member.name for member in source.getmembers() if member.isfile()}
            faults += source_faults(names, expected)
        print(f"{Path(archive).name}: {len(names)} files")
    print(*faults, sep="\n", end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
