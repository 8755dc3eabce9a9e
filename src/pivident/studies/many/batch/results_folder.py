"""Results on disk: a manifest with the program's fingerprint, and Parquet shards only added to.

A shard is written under another name, synchronised to disk and then renamed, so it exists either
completely or not at all. The shards themselves are the only list of finished tasks.

Fingerprint of the program: the version alone does not identify code under development.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from pivident.foundation.extras import require
from pivident.foundation.files import regular_file
from pivident.foundation.version import __version__
from pivident.studies.many.batch.batch_errors import OtherContents, ResultsFolderError

if TYPE_CHECKING:
    import polars as pl

#: A row of a shard by column.
Row = dict[str, Any]
#: Version of the layout of the folder.
LAYOUT = 1
MANIFEST, LOCK = "manifest.json", "lock"
#: Largest manifest that is read [bytes].
MAX_MANIFEST = 2**22
#: Names of files that are being written.
UNFINISHED = ".unfinished-"
#: Folders whose code affects the numbers of a result.
NUMERICAL = (
    "data/recording", "dynamics", "estimation", "experiment", "loop", "robot", "signals",
    "studies/friction", "studies/many/fleet", "studies/many/study",
)  # fmt: skip


@cache
def fingerprint() -> str:
    """Version of pivident with the first digits of the SHA-256 of its numerical code."""
    package = Path(__file__).resolve().parents[3]
    digest = hashlib.sha256()
    for name in NUMERICAL:
        for file in sorted((package / name).rglob("*.py")):
            digest.update(file.relative_to(package).as_posix().encode())
            digest.update(file.read_bytes())
    return f"{__version__} ({digest.hexdigest()[:12]})"


class ResultsFolder:
    """The folder with the results of many tasks of one kind."""

    shards_name: ClassVar[str] = "results"  # subfolder of the shards
    owner: ClassVar[str] = "task"  # owner of the results; key of its tables in the manifest
    work: ClassVar[str] = "command"  # name of the writing program in messages
    rows_name: ClassVar[str] = "results"  # name of the results in messages
    error: ClassVar[type[ResultsFolderError]] = ResultsFolderError
    other: ClassVar[type[OtherContents]] = OtherContents  # error for results of something else

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        self.shards = self.folder / self.shards_name

    def schema(self) -> dict[str, Any]:
        """Columns of a shard."""
        raise NotImplementedError

    @contextmanager
    def taken(self, wanted: Mapping[str, Any]) -> Iterator[None]:
        """Lock the folder, after creating it or checking that it belongs to this owner.

        ``wanted`` is the manifest: ``hash``, the owner's tables, and notes.
        """
        require("polars", extra="tables", purpose="a folder of many results")
        with self._errors():
            if self.folder.exists() and not self.folder.is_dir():
                raise self.error(self.folder, "it is a file", "choose another --out")
            manifest = self.manifest() if self.folder.exists() else None
            if manifest is not None:
                self._check(manifest, wanted)
            elif self.folder.exists() and any(self.folder.iterdir()):
                others = {p.name for p in self.folder.iterdir()} - {LOCK, self.shards_name}
                if {o for o in others if not o.startswith(UNFINISHED)}:
                    raise self.error(
                        self.folder,
                        "it contains other files and no manifest.json",
                        "choose a new folder for --out",
                    )
            self.shards.mkdir(parents=True, exist_ok=True)
            with self._locked():
                for left in (
                    *self.folder.glob(f"{UNFINISHED}*"),
                    *self.shards.glob(f"{UNFINISHED}*"),
                ):
                    left.unlink()
                self._write_manifest(manifest, wanted)
                yield

    def manifest(self) -> dict[str, Any] | None:
        """The manifest, None without one."""
        path = self.folder / MANIFEST
        try:
            if regular_file(path).stat().st_size > MAX_MANIFEST:
                raise ValueError("it is too large")
            content = json.loads(path.read_text("utf-8"))
            self._check_kinds(content)
            return content
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            raise self.error(
                self.folder, f"{MANIFEST} cannot be read ({error})", "choose another folder"
            ) from error

    def programs(self) -> tuple[str, ...]:
        """Every state of the program that has written to the folder."""
        return tuple((self.manifest() or {}).get("programs", ()))

    def append(self, rows: Sequence[Row]) -> None:
        """Write rows as one more shard; after an error the folder is as it was."""
        pl = require("polars", extra="tables", purpose="a folder of many results")
        if not rows:
            return
        buffer = io.BytesIO()
        pl.DataFrame(rows, schema=self.schema()).write_parquet(buffer)
        name = f"{self.shard_name(rows)}-{secrets.token_hex(4)}.parquet"
        self.write(f"{self.shards_name}/{name}", buffer.getvalue())

    def shard_name(self, rows: Sequence[Row]) -> str:
        """Prefix of a shard's name."""
        return f"{len(rows):06d}"

    def write(self, name: str, content: bytes | str) -> None:
        """Write a file of the folder atomically."""
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

    def read(self, columns: Sequence[str] | None = None) -> pl.DataFrame:
        """All rows of all shards, in the order of their names."""
        pl = require("polars", extra="tables", purpose="a folder of many results")
        frames = []
        for shard in sorted(p for p in self.shards.glob("*.parquet") if not p.name.startswith(".")):
            try:
                wanted = None if columns is None else list(columns)
                frames.append(pl.read_parquet(shard, columns=wanted))
            except Exception as error:
                raise self.error(
                    shard,
                    f"this shard cannot be read ({type(error).__name__})",
                    f"delete it: its {self.rows_name} are then computed again",
                ) from error
        if frames:
            return pl.concat(frames, how="diagonal")  # shards of older programs have fewer columns
        schema = self.schema()
        return pl.DataFrame(schema={name: schema[name] for name in columns or schema})

    def _check(self, manifest: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
        if manifest.get("layout") != LAYOUT or self.owner not in manifest:
            raise self.error(
                self.folder,
                f"its manifest.json is not that of a {self.work}",
                "choose another folder",
            )
        if manifest["hash"] != wanted["hash"]:
            raise self.other(self.folder, differences(wanted[self.owner], manifest[self.owner]))
        if manifest["version"] != __version__:
            raise self.error(
                self.folder,
                f"its {self.rows_name} were made by pivident {manifest['version']}, this is "
                f"{__version__}",
                f"choose another folder: {self.rows_name} of two versions do not belong together",
            )

    def _write_manifest(
        self, manifest: Mapping[str, Any] | None, wanted: Mapping[str, Any]
    ) -> None:
        import numpy as np

        programs = list((manifest or {}).get("programs", []))
        programs += [fingerprint()] * (fingerprint() not in programs)
        complete = {
            "layout": LAYOUT,
            **wanted,
            "version": __version__,
            "programs": programs,
            "numpy": np.__version__,
        }
        if manifest != complete:
            self.write(MANIFEST, json.dumps(complete, indent=1, default=str))

    def _check_kinds(self, content: Any) -> None:
        """Refuse a manifest that was not written by this program."""
        if not isinstance(content, dict):
            raise ValueError("it is not a table")
        kinds = {self.owner: dict, "hash": str, "version": str, "programs": list}
        for key, kind in (kinds | self.manifest_kinds()).items():
            if key in content and not isinstance(content[key], kind):
                raise ValueError(f"{key} has the wrong type")
            if key not in content and "layout" in content:
                raise ValueError(f"{key} is missing")
        if not all(isinstance(program, str) for program in content.get("programs", ())):
            raise ValueError("programs have the wrong type")

    def manifest_kinds(self) -> dict[str, type]:
        """Further keys of the manifest that are read back, with their types."""
        return {}

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Exclusive lock of the folder, released when the process ends."""
        try:
            import fcntl
        except ImportError:  # no such locks on this system: unique names still protect shards
            yield
            return
        with (self.folder / LOCK).open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise self.error(
                    self.folder,
                    f"another {self.work} is writing to it",
                    "wait until it has ended, or choose another --out",
                ) from error
            yield

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Errors of the disk with the next step."""
        try:
            yield
        except OSError as error:
            raise self.error(
                self.folder,
                f"cannot be written to ({error.strerror or error})",
                "free some space, change its permissions or choose another --out; the "
                f"{self.rows_name} in it are unchanged; run the same command to continue",
            ) from error


def differences(here: Any, there: Any, key: str = "") -> list[str]:
    """Differences between two sets of tables, as ``table.key: here / there``."""
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


def _sync_folder(folder: Path) -> None:
    """Synchronise a rename to disk, if folders can be opened."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


#: Largest length of an error message.
MAX_MESSAGE = 500


def failure(error: BaseException, seconds: float) -> Row:
    """Error class and message in place of estimates."""
    notes = "".join(f" ({n})" for n in getattr(error, "__notes__", ()))
    message = (" ".join(str(error).split()) + notes)[:MAX_MESSAGE]
    return {"error": type(error).__name__, "message": message, "seconds": seconds}
