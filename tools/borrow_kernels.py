"""Take over compiled kernels from another checkout: ``python tools/borrow_kernels.py OTHER``.

A fresh checkout compiles for minutes what another one has compiled already. Numba keeps its results
beside each module, and knows them by the time and size of that one file. So they are copied, and
the time of the file with them, where the module and all modules of pivident that it imports are the
same in both checkouts: a kernel that calls a changed one is compiled again.
"""

from __future__ import annotations

import ast
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]


def sources(checkout: Path) -> dict[str, Path]:
    """Modules of a checkout by name."""
    root = checkout / "src"
    return {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted((root / "pivident").rglob("*.py"))
    }


def imported(text: str, known: dict[str, Path]) -> Iterator[str]:
    """Modules among the known ones that a text imports anywhere."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        yield from (name for name in names if name in known)


def unchanged(ours: dict[str, Path], theirs: dict[str, Path]) -> set[str]:
    """Modules that are the same in both, with all that they import."""
    text = {name: path.read_text(encoding="utf-8") for name, path in ours.items()}
    needs = {name: set(imported(own, ours)) - {name} for name, own in text.items()}
    same = {
        name
        for name, own in text.items()
        if name in theirs and theirs[name].read_text(encoding="utf-8") == own
    }
    while changed := {name for name in same if not needs[name] <= same}:
        same -= changed
    return same


def borrow(own: Path, other: Path) -> int:
    """Copy what another checkout has compiled; how many files."""
    ours, theirs = sources(own), sources(other)
    copied = 0
    for name in sorted(unchanged(ours, theirs)):
        source, target = theirs[name], ours[name]
        made = [
            path
            for ending in ("nbi", "nbc")
            for path in (source.parent / "__pycache__").glob(f"{source.stem}.*.{ending}")
        ]
        if not made:
            continue
        stamp = source.stat()
        os.utime(target, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
        folder = target.parent / "__pycache__"
        folder.mkdir(exist_ok=True)
        for path in made:
            shutil.copy2(path, folder / path.name)
        copied += len(made)
    return copied


if __name__ == "__main__":
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "src" / "pivident").is_dir():
        sys.exit("name another checkout of pivident: python tools/borrow_kernels.py ../other")
    print(f"{borrow(HERE, Path(sys.argv[1]).resolve())} files of compiled kernels taken over")
