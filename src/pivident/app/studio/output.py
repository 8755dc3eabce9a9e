"""What a command says: kept in bounded files while it runs, and cleaned for a page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import BinaryIO

from pivident.foundation.text.identifiers import escaped

#: Bytes of a stream that are kept from its beginning, and from its end where it is longer.
MAX_BYTES, LAST = 1_000_000, 64_000

#: Characters of it that a page shows.
SHOWN = 200_000

#: What terminals take for commands: CSI, OSC up to its end, and those of two characters.
_SEQUENCES = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b\n]*(?:\x07|\x1b\\)?|[ -~])")


class KeptStream:
    """Bytes of a stream in a file: the beginning, and the end of what is too long.

    A disk that is full loses the file and not the end, which stays in memory.

    Attributes:
        trouble: why not all of it could be written, in words; empty where it could.
    """

    def __init__(self, path: Path, most: int = MAX_BYTES, last: int = LAST) -> None:
        self._most, self._last = most, last
        self._size = 0
        self._end = b""
        self._file: BinaryIO | None = None
        self.trouble = ""
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            self.trouble = error.strerror or str(error)

    def feed(self, chunk: bytes) -> None:
        """Take the next bytes."""
        self._write(chunk[: max(self._most - self._size, 0)])
        self._size += len(chunk)
        self._end = (self._end + chunk)[-self._last :]

    def close(self) -> None:
        """Write the end of what was too long."""
        if self._size > self._most:
            end = self._end[-min(self._last, self._size - self._most) :]
            left_out = self._size - self._most - len(end)
            between = f"\n… {left_out} bytes left out …\n" if left_out else ""
            self._write(between.encode() + end)
        if self._file is not None:
            self._file.close()
            self._file = None

    @property
    def end(self) -> str:
        """The last that was said."""
        return self._end.decode("utf-8", "replace")

    def _write(self, content: bytes) -> None:
        if self._file is None or not content:
            return
        try:
            written = self._file.write(content)
            if written != len(content):
                self._file.write(content[written:])
        except OSError as error:
            self.trouble = error.strerror or str(error)
            self._file.close()
            self._file = None


def cleaned(text: str) -> str:
    """Text without what controls a terminal; of a line that was overwritten, what was seen last."""
    lines = _SEQUENCES.sub("", text).split("\n")
    return escaped("\n".join(line.rstrip("\r").rpartition("\r")[2] for line in lines))


def shown(path: Path, most: int = SHOWN) -> str:
    """Clean text of a file, its beginning and its end where it is longer; empty without a file."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(0)
            if size <= most:
                return cleaned(file.read().decode("utf-8", "replace"))
            begin = file.read(most // 2)
            file.seek(size - most // 2)
            end = file.read()
    except OSError:
        return ""
    texts = [cleaned(part.decode("utf-8", "replace")) for part in (begin, end)]
    return f"\n… {size - most} bytes left out …\n".join(texts)


def last_line(text: str) -> str:
    """The last error line of a command, or else the last line."""
    lines = [line.strip() for line in cleaned(text).splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("error:")]
    return (errors or lines or [""])[-1]
