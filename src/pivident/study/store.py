"""Results of a study on disk: a manifest, and Parquet shards that only ever get more.

A shard is written under another name, forced to disk and then renamed, so that it is either there
as a whole or not at all. Which runs are done is read from the shards themselves; there is no other
list that could disagree with them.
"""

from __future__ import annotations

import io
import json
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pivident.files import regular_file
from pivident.study.errors import OtherScenario, StudyFolderError
from pivident.study.fingerprint import fingerprint
from pivident.study.run import Row

if TYPE_CHECKING:
    import polars as pl

    from pivident.study.scenario import Scenario

#: Version of the layout of the folder.
LAYOUT = 1

MANIFEST, SHARDS, LOCK = "manifest.json", "runs", "lock"

#: Largest manifest that is read [bytes].
LARGEST_MANIFEST = 2**22

#: Names of files that are being written.
UNFINISHED = ".unfinished-"


def row_schema() -> dict[str, Any]:
    """Columns of a shard."""
    import polars as pl

    numbers, text = pl.List(pl.Float64), pl.String
    return {
        "run": pl.Int64,
        "record": pl.Int64,
        "start": pl.Int64,
        "method": text,
        "converged": pl.Boolean,
        "iterations": pl.Int64,
        "theta": numbers,
        "std": numbers,
        "robust_std": numbers,
        "formula_std": numbers,
        "relative_error": pl.Float64,
        "condition": pl.Float64,
        "d_tau": pl.Float64,
        "d_q": pl.Float64,
        "d_beta": pl.Float64,
        "seconds": pl.Float64,
        "error": text,
        "message": text,
    }


class Store:
    """The results folder of one scenario, or of one condition of it.

    Args:
        folder: the folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        self.shards = self.folder / SHARDS

    @contextmanager
    def opened(self, scenario: Scenario, runs: int) -> Iterator[Store]:
        """Take the folder for a study: make it, or check that it belongs to the scenario.

        Args:
            scenario: the scenario.
            runs: how many runs are wanted.

        Raises:
            OtherScenario: it holds runs of another scenario; nothing is changed.
            StudyFolderError: it cannot be written to, another study is writing to it, or it is
                not a folder of results.
        """
        with self._errors():
            if self.folder.exists() and not self.folder.is_dir():
                raise StudyFolderError(self.folder, "it is a file", "choose another --out")
            manifest = self.manifest() if self.folder.exists() else None
            if manifest is not None:
                self._check(manifest, scenario)
            elif self.folder.exists() and any(self.folder.iterdir()):
                others = {p.name for p in self.folder.iterdir()} - {LOCK, SHARDS}
                if {o for o in others if not o.startswith(UNFINISHED)}:
                    raise StudyFolderError(
                        self.folder,
                        "it holds other files and no manifest.json",
                        "choose a new folder for --out",
                    )
            self.shards.mkdir(parents=True, exist_ok=True)
            with self._locked():
                for left in (
                    *self.folder.glob(f"{UNFINISHED}*"),
                    *self.shards.glob(f"{UNFINISHED}*"),
                ):
                    left.unlink()
                self._write_manifest(manifest, scenario, runs)
                yield self

    def manifest(self) -> dict[str, Any] | None:
        """The manifest, None where there is none.

        Raises:
            StudyFolderError: it cannot be read.
        """
        path = self.folder / MANIFEST
        try:
            if regular_file(path).stat().st_size > LARGEST_MANIFEST:
                raise ValueError("it is too large")
            content = json.loads(path.read_text("utf-8"))
            _check_manifest(content)
            return content
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            raise StudyFolderError(
                self.folder, f"{MANIFEST} cannot be read ({error})", "choose another folder"
            ) from error

    def programs(self) -> tuple[str, ...]:
        """Every state of the program that has written to the folder."""
        return tuple((self.manifest() or {}).get("programs", ()))

    def append(self, rows: Sequence[Row]) -> None:
        """Write rows as one more shard.

        Args:
            rows: all rows of some runs.

        Raises:
            StudyFolderError: the disk is full, or the folder cannot be written to. What was
                there before is as it was.
        """
        import polars as pl

        if not rows:
            return
        buffer = io.BytesIO()
        pl.DataFrame(rows, schema=row_schema()).write_parquet(buffer)
        runs = [row["run"] for row in rows]
        name = f"{min(runs):08d}-{max(runs):08d}-{secrets.token_hex(4)}.parquet"
        self.write(f"{SHARDS}/{name}", buffer.getvalue())

    def write(self, name: str, content: bytes | str) -> None:
        """Write a file of the folder: as a whole, or not at all.

        Args:
            name: path inside the folder.
            content: bytes or text.

        Raises:
            StudyFolderError: it cannot be written.
        """
        path = self.folder / name
        unfinished = path.parent / f"{UNFINISHED}{secrets.token_hex(4)}"
        data = content.encode() if isinstance(content, str) else content
        with self._errors():
            try:
                with unfinished.open("wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(unfinished, path)
                _sync_folder(path.parent)
            except BaseException:
                unfinished.unlink(missing_ok=True)
                raise

    def rows(self) -> pl.DataFrame:
        """All rows, sorted by run and method; each run once.

        Raises:
            StudyFolderError: a shard cannot be read.
        """
        import polars as pl

        frames = []
        for shard in self._shard_files():
            try:
                frames.append(pl.read_parquet(shard))
            except Exception as error:
                raise StudyFolderError(
                    shard,
                    f"this shard cannot be read ({type(error).__name__})",
                    "delete it: its runs are then computed again",
                ) from error
        table = pl.concat(frames) if frames else pl.DataFrame(schema=row_schema())
        # two studies cannot write at once, so a run is there twice only if a shard was copied
        return table.unique(["run", "method"], keep="first").sort("run", "method")

    def done(self) -> set[int]:
        """Numbers of the runs that are on disk."""
        import polars as pl

        found: set[int] = set()
        for shard in self._shard_files():
            try:
                found.update(pl.read_parquet(shard, columns=["run"])["run"].to_list())
            except Exception as error:
                raise StudyFolderError(
                    shard,
                    f"this shard cannot be read ({type(error).__name__})",
                    "delete it: its runs are then computed again",
                ) from error
        return found

    def _shard_files(self) -> list[Path]:
        return sorted(p for p in self.shards.glob("*.parquet") if not p.name.startswith("."))

    def _check(self, manifest: Mapping[str, Any], scenario: Scenario) -> None:
        from pivident import __version__

        if manifest.get("layout") != LAYOUT or "scenario" not in manifest:
            raise StudyFolderError(
                self.folder, "its manifest.json is not that of a study", "choose another folder"
            )
        if manifest["hash"] != scenario.hash:
            raise OtherScenario(self.folder, differences(scenario.identity, manifest["scenario"]))
        if manifest["version"] != __version__:
            raise StudyFolderError(
                self.folder,
                f"its runs were made by pivident {manifest['version']}, this is {__version__}",
                "choose another folder: runs of two versions do not belong together",
            )

    def _write_manifest(
        self, manifest: Mapping[str, Any] | None, scenario: Scenario, runs: int
    ) -> None:
        import numpy as np

        from pivident import __version__

        programs = list((manifest or {}).get("programs", []))
        programs += [fingerprint()] * (fingerprint() not in programs)
        wanted = {
            "layout": LAYOUT,
            "name": scenario.title,
            "description": scenario.content.description,
            "hash": scenario.hash,
            "scenario": scenario.identity,
            "seed": scenario.content.seed,
            "methods": {name: _options(m) for name, m in scenario.methods.items()},
            "runs": max(runs, (manifest or {}).get("runs", 0)),
            "version": __version__,
            "programs": programs,
            "numpy": np.__version__,
        }
        if manifest != wanted:
            self.write(MANIFEST, json.dumps(wanted, indent=1, default=str))

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Keep a second study out of the folder; the lock ends with the process."""
        try:
            import fcntl
        except ImportError:  # no such locks here: unique names still keep shards whole
            yield
            return
        with (self.folder / LOCK).open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise StudyFolderError(
                    self.folder,
                    "another study is writing to it",
                    "wait until it has ended, or choose another --out",
                ) from error
            yield

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Problems with the disk in words."""
        try:
            yield
        except OSError as error:
            raise StudyFolderError(
                self.folder,
                f"cannot be written to ({error.strerror or error})",
                "free some space, change its permissions or choose another --out; the runs that "
                "are in it are as they were, and the same command goes on from there",
            ) from error


def _check_manifest(content: Any) -> None:
    """Refuse what was not written here, whether or not its layout is known.

    Raises:
        ValueError: it is no table, or a key holds a value of another kind.
    """
    if not isinstance(content, dict):
        raise ValueError("it is not a table")
    kinds = {"scenario": dict, "hash": str, "runs": int, "version": str, "programs": list}
    for key, kind in kinds.items():
        if key in content and not isinstance(content[key], kind):
            raise ValueError(f"{key} is of another kind")
        if key not in content and "layout" in content:
            raise ValueError(f"{key} is missing")
    if not all(isinstance(program, str) for program in content.get("programs", ())):
        raise ValueError("programs are of another kind")


def differences(here: Any, there: Any, key: str = "") -> list[str]:
    """What differs between two scenarios, as ``table.key: here / there``.

    Args:
        here: plain values.
        there: likewise.
        key: what they are called.
    """
    if isinstance(here, Mapping) and isinstance(there, Mapping):
        found = []
        for name in dict.fromkeys([*here, *there]):
            inner = f"{key}.{name}" if key else str(name)
            found += differences(here.get(name), there.get(name), inner)
        return found
    return [] if here == there else [f"{key}: {_short(here)} here, {_short(there)} there"]


def _short(value: Any) -> str:
    text = "not given" if value is None else repr(value)
    return text if len(text) <= 40 else f"{text[:37]}…"


def _options(method: Any) -> dict[str, Any]:
    import dataclasses

    return json.loads(json.dumps(dataclasses.asdict(method), default=str))


def _sync_folder(folder: Path) -> None:
    """Force a rename to disk, where folders can be opened."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
