"""Golden results: every number that the program prints or writes, kept and compared.

    PIVIDENT_DATA=FOLDER python benchmarks/golden_results.py make FOLDER_A
    python benchmarks/golden_results.py compare FOLDER_A FOLDER_B

`make` runs the command line of `pivident` (that of PYTHONPATH, else of this working tree), each
case of `golden/cases.py` in a folder of its own, and keeps what was printed (`printed/`) and all
files. `compare` says which numbers differ. Values of JSON, CSV, TOML, Parquet, NPZ and XML are
compared to the last digit at their key. Keys that only one side has are listed: if their numbers
are the same, they have been renamed, which is no difference. Of text and pages, the numerals count,
however they are worded and in whatever order; in C, Python and LaTeX in their order. Dates,
durations, versions, hashes in text and names of folders do not count. Exit code 1: something
differs. All runs have one thread, on which the last bits of sums depend.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import distributions
from pathlib import Path

from golden.cases import CASES, Step
from golden.numerals import Content, read

TREE = Path(__file__).resolve().parents[1]

#: The program with a clock that counts.
COUNTED = TREE / "benchmarks" / "golden" / "counted_clock.py"

#: One thread, one width, one hash seed: what else numbers and their layout could depend on.
SETTINGS = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
) | {
    "COLUMNS": "160",
    "NO_COLOR": "1",
    "LC_ALL": "C.UTF-8",
    "PYTHONHASHSEED": "0",
    "PIVIDENT_THREADS": "1",
    "TZ": "UTC",
}

#: Another version of one of these may round differently.
LIBRARIES = ("numpy", "scipy", "numba", "sympy")

#: Exit codes of commands that have done their work.
DONE = (0, 3, 4)

#: Values of keys that may come and go.
NO_NUMBERS = ("null", "True", "False")

#: At most so many lines about a file.
SHOWN = 12


def environment(data: Path) -> dict[str, str]:
    """Variables of all runs."""
    source = os.environ.get("PYTHONPATH") or str(TREE / "src")
    return {**os.environ, **SETTINGS, "PYTHONPATH": source, "PIVIDENT_DATA": str(data)}


def run(step: Step, folder: Path, variables: dict[str, str]) -> tuple[int, float]:
    """One command in a folder: its exit code and processor time [s]."""
    printed = folder / "printed"
    printed.mkdir(exist_ok=True)
    program = [str(COUNTED)] if step.counted else ["-m", "pivident"]
    command = [sys.executable, *program, *step.arguments()]
    with (
        (printed / f"{step.label}.out").open("wb") as out,
        (printed / f"{step.label}.err").open("wb") as err,
    ):
        process = subprocess.Popen(command, cwd=folder, env=variables, stdout=out, stderr=err)
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, used.ru_utime + used.ru_stime


def make_case(name: str, folder: Path, variables: dict[str, str]) -> None:
    """Prepare a case and run its steps."""
    data = Path(variables["PIVIDENT_DATA"])
    folder.mkdir(parents=True)
    os.environ.update(variables)  # for the scripts that make logs
    CASES[name].prepare(folder, data)
    codes = {}
    for step in CASES[name].steps:
        code, seconds = run(step, folder, variables)
        codes[step.label] = code
        print(f"{name:9} {step.label:18} exit {code}, {seconds:6.1f} s of processor", flush=True)
        if code not in DONE:
            print(f"  failed: {shlex.join(step.arguments())}", flush=True)
    (folder / "printed" / "exit_codes.json").write_text(json.dumps(codes, indent=1))


def make(target: Path, data: Path, names: Iterable[str], jobs: int) -> int:
    """Run the cases; the exit code is 1 if a command failed."""
    target = target.resolve()
    variables = environment(data.resolve())
    there = {one.metadata["Name"]: one.version for one in distributions()}
    libraries = {name: there.get(name) for name in LIBRARIES}
    where = subprocess.run(
        [sys.executable, "-c", "import pivident; print(pivident.__file__)"],
        env=variables,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    print(f"program: {where}")
    target.mkdir(parents=True, exist_ok=True)
    roots = [str(target), str(data.resolve()), str(Path(where).parents[2]), str(TREE)]
    about = {"roots": roots, "libraries": libraries}
    (target / "golden.json").write_text(json.dumps(about, indent=1))
    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(lambda name: make_case(name, target / name, variables), names))
    codes = [
        code
        for name in names
        for code in json.loads((target / name / "printed" / "exit_codes.json").read_text()).values()
    ]
    return int(any(code not in DONE for code in codes))


def apart(a: Iterable[tuple[str, str]], b: Iterable[tuple[str, str]]) -> list[str]:
    """Numbers that only one side has, each with its line."""
    first, second = list(a), list(b)
    counts = Counter(number for number, _ in first), Counter(number for number, _ in second)
    told = []
    for word, side, ours, others in (
        ("lost  ", first, counts[0], counts[1]),
        ("gained", second, counts[1], counts[0]),
    ):
        lines = dict(reversed(side))
        for number, times in (ours - others).items():
            more = f" ({times} times)" if times > 1 else ""
            told.append(f"{word} {number}{more}: {lines[number][:110]}")
    return told


def differences(a: Content, b: Content) -> tuple[list[str], list[str]]:
    """What differs between two files, and notes about keys that have been renamed."""
    told = [
        f"{key}: {a.values[key]} → {b.values[key]}"
        for key in a.values
        if key in b.values and a.values[key] != b.values[key]
    ]
    gone, new = ([key for key in x.values if key not in y.values] for x, y in ((a, b), (b, a)))
    told += apart(
        ((a.values[key], f"key {key}") for key in gone if a.values[key] not in NO_NUMBERS),
        ((b.values[key], f"key {key}") for key in new if b.values[key] not in NO_NUMBERS),
    )
    notes = [f"renamed or missing: {key}" for key in gone] + [f"new: {key}" for key in new]
    numbers = a.numerals(), b.numerals()
    words = apart(*numbers)
    told += words
    if a.ordered and not words and [n for n, _ in numbers[0]] != [n for n, _ in numbers[1]]:
        told.append("the same numbers in another order")
    told += apart(
        ((number, "in a figure") for number in a.coordinates),
        ((number, "in a figure") for number in b.coordinates),
    )
    return told, notes


def files(folder: Path, names: Iterable[str]) -> dict[str, Path]:
    """Files of the cases by their place in the folder."""
    return {
        str(path.relative_to(folder)): path
        for name in names
        for path in sorted((folder / name).rglob("*"))
        if path.is_file()
    }


def renamed(a: dict[str, Path], b: dict[str, Path], roots: list[str]) -> dict[str, str]:
    """Files of one case that only the name sets apart."""
    pairs: dict[str, str] = {}
    for old in a.keys() - b.keys():
        for new in sorted(b.keys() - a.keys() - set(pairs.values())):
            alike = old.split("/")[0] == new.split("/")[0] and a[old].suffix == b[new].suffix
            if alike and not differences(read(a[old], roots), read(b[new], roots))[0]:
                pairs[old] = new
                break
    return pairs


def compare(first: Path, second: Path, names: list[str]) -> int:
    """Print what differs; 1 if anything does."""
    made = [json.loads((folder / "golden.json").read_text()) for folder in (first, second)]
    roots = [root for one in made for root in one["roots"]]
    if made[0].get("libraries") != made[1].get("libraries"):
        print(f"libraries: {made[0].get('libraries')} and {made[1].get('libraries')}")
    a, b = files(first, names), files(second, names)
    pairs = {name: name for name in a.keys() & b.keys()} | renamed(a, b, roots)
    wrong, numbers, same = 0, 0, 0
    for name in sorted(a):
        if name not in pairs:
            print(f"MISSING {name}")
            wrong += 1
            continue
        if a[name].read_bytes() == b[pairs[name]].read_bytes() and pairs[name] == name:
            same += 1
            continue
        contents = read(a[name], roots), read(b[pairs[name]], roots)
        told, notes = differences(*contents)
        numbers += sum(map(len, (contents[0].values, contents[0].coordinates)))
        numbers += len(contents[0].numerals())
        if pairs[name] != name:
            notes.insert(0, f"the file is called {pairs[name]} now")
        if told or notes:
            print(f"{'DIFFERS' if told else 'same numbers'} {name}")
        for lines in (told, notes):
            for line in lines[:SHOWN]:
                print(f"    {line}")
            if len(lines) > SHOWN:
                print(f"    … and {len(lines) - SHOWN} more")
        wrong += bool(told)
    for name in sorted(b.keys() - set(pairs.values())):
        print(f"NEW     {name}")
        wrong += 1
    result = f"{wrong} files differ" if wrong else "identical"
    print(
        f"{result}: {len(a)} files, {same} of them byte for byte, {numbers} numbers in the others"
    )
    return int(wrong > 0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", action="append", choices=list(CASES), help="case; repeatable")
    actions = parser.add_subparsers(dest="action", required=True)
    making = actions.add_parser("make")
    making.add_argument("folder", type=Path)
    making.add_argument("--jobs", type=int, default=2, help="cases at a time")
    comparing = actions.add_parser("compare")
    comparing.add_argument("first", type=Path)
    comparing.add_argument("second", type=Path)
    for action in (making, comparing):
        action.add_argument(
            "--only", action="append", choices=list(CASES), default=argparse.SUPPRESS
        )
    options = parser.parse_args()
    if options.action == "make":
        data = Path(os.environ.get("PIVIDENT_DATA") or TREE.parent / "shared" / "data")
        return make(options.folder, data, options.only or list(CASES), options.jobs)
    there = [name for name in CASES if (options.first / name).is_dir()]
    return compare(options.first, options.second, options.only or there)


if __name__ == "__main__":
    sys.exit(main())
