"""One process that feeds a reader until it has had enough, or dies of an input.

The engine is atheris (coverage-guided, libFuzzer) where it is installed, else the same mutations
without the guidance. Every input lies in a file before it is read, so that the parent knows what
killed the process.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import random
import resource
import struct
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path

#: Memory that one input may take beyond what the process has [bytes].
MEMORY = 2 * 2**30

#: Seconds after which the engine gives an input up and dies.
HANGING = 290

#: Packages whose branches guide the search: ours, and pure Python that it parses with.
GUIDED = ["pivident", "tomllib", "xml", "zipfile"]

#: Folders of ours that read files; others hold compiled loops, which cannot be instrumented.
READING = ("robot", "recording", "experiment", "study")


class Judge:
    """Feeds inputs to a reader, counts, and writes findings.

    Args:
        name: key of the reader.
        folder: for the input, the counts and the findings.
    """

    def __init__(self, name: str, folder: Path) -> None:
        from fuzzing.readers import READERS
        from pivident.foundation.errors import PividentError

        self.name, self.folder, self.reader = name, folder, READERS[name]
        self.expected: type[BaseException] = PividentError
        self.input = folder / "input" / self.reader.file
        self.input.parent.mkdir(exist_ok=True)
        self.count = self.answers = self.refused = 0
        self.slowest, self.seen = 0.0, set[str]()
        self.state = (folder / "state").open("r+b" if (folder / "state").exists() else "w+b")

    def __call__(self, data: bytes) -> None:
        """Read one input."""
        self.input.write_bytes(data)
        self.count += 1
        self.tell()
        begin = time.process_time()
        try:
            self.reader.read(self.input)
            self.answers += 1
        except self.expected as error:
            self.refused += 1
            if len(str(error)) > 20000:
                self.found("endless message", f"{len(str(error))} characters", data, "")
        except MemoryError as error:
            self.found("MemoryError", _place(error), data)
        except BaseException as error:
            kind = type(error).__name__
            self.found(kind, f"{_place(error)}: {str(error)[:200]}", data, _place(error))
        spent = time.process_time() - begin
        if spent > self.reader.patience and self._slow_again():
            self.found("slow", f"{spent:.1f} s", data)
        elif spent <= self.reader.patience:
            self.slowest = max(self.slowest, spent)

    def _slow_again(self) -> bool:
        """Whether it was no accident."""
        begin = time.process_time()
        with contextlib.suppress(BaseException):
            self.reader.read(self.input)
        return time.process_time() - begin > self.reader.patience

    def tell(self) -> None:
        """Leave the counts where the parent finds them."""
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        line = struct.pack("<3Q2d", self.count, self.answers, self.refused, self.slowest, peak)
        os.pwrite(self.state.fileno(), line, 0)

    def found(self, kind: str, text: str, data: bytes, key: str | None = None) -> None:
        """Keep an input that did what it must not, one of each kind and place."""
        mark = f"{kind} {text if key is None else key}" if kind != "slow" else "slow"
        if mark in self.seen:
            return
        self.seen.add(mark)
        digest = hashlib.sha256(data).hexdigest()[:12]
        kept = self.folder / "findings"
        kept.mkdir(exist_ok=True)
        (kept / f"{kind.replace(' ', '-')}-{digest}").write_bytes(data)
        with (self.folder / "findings.jsonl").open("a") as file:
            file.write(
                json.dumps({"kind": kind, "text": text, "input": digest, "mark": mark}) + "\n"
            )


def _place(error: BaseException) -> str:
    """The innermost lines of ours and of all."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "pivident" in f.filename]
    last = [own[-1]] if own else []
    last += [frames[-1]] if frames and frames[-1] not in last else []
    return " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in last)


def limit_memory() -> None:
    """Let the process grow by `MEMORY` and no further."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def feed_plainly(judge: Judge, count: int, seed: int) -> None:
    """The mutations alone, from the seeds and from what became of them."""
    rng = random.Random(seed)
    corpus = list(judge.reader.seeds())
    for data in corpus:
        judge(data)
    while judge.count < count:
        before = judge.answers
        data = judge.reader.mutated(rng.choice(corpus), rng)
        judge(data)
        if judge.answers > before:
            corpus.append(data)
        if len(corpus) > 500:
            del corpus[rng.randrange(len(corpus))]
    judge.tell()


def feed_guided(judge: Judge, count: int, seed: int) -> None:
    """Inputs that reach new branches are changed further."""
    import atheris

    corpus = judge.folder / "corpus"
    if not corpus.exists():
        corpus.mkdir()
        for k, data in enumerate(judge.reader.seeds()):
            (corpus / f"seed{k}").write_bytes(data)

    def mutator(data: bytes, largest: int, number: int) -> bytes:
        rng = random.Random(number)
        if rng.random() < 0.1:
            return atheris.Mutate(data, len(data))
        return judge.reader.mutated(data, rng)[:largest]

    options = [
        "fuzz", f"-runs={count}", f"-seed={seed % 2**31 or 1}", "-max_len=262144",
        f"-timeout={HANGING}", "-rss_limit_mb=0", "-malloc_limit_mb=0", "-detect_leaks=0",
        "-verbosity=0", "-print_final_stats=0", "-reduce_inputs=0", "-len_control=0",
        f"-artifact_prefix={judge.folder}/", str(corpus),
    ]  # fmt: skip
    atheris.Setup(options, judge, custom_mutator=mutator)
    try:
        atheris.Fuzz()
    finally:
        judge.tell()


def _unguided() -> list[str]:
    """Modules of ours outside the folders that read files."""
    package = Path(__file__).resolve().parents[2] / "src" / "pivident"
    modules = [file.relative_to(package.parent).with_suffix("") for file in package.rglob("*.py")]
    return [".".join(m.parts) for m in modules if m.parts[1] not in READING]


def main() -> None:
    name, folder, engine, count, seed = sys.argv[1:6]
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    feed: Callable[[Judge, int, int], None] = feed_plainly
    instrumented: contextlib.AbstractContextManager[object] = contextlib.nullcontext()
    if engine == "atheris":
        import atheris

        feed, instrumented = feed_guided, atheris.instrument_imports(GUIDED, _unguided())
    with instrumented:
        judge = Judge(name, Path(folder))
        for data in judge.reader.seeds():  # imports what is needed, before memory is counted
            judge.input.write_bytes(data)
            with contextlib.suppress(judge.expected):
                judge.reader.read(judge.input)
    limit_memory()
    feed(judge, int(count), int(seed))


if __name__ == "__main__":
    main()
