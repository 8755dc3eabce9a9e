"""Compressed chunks of a bag, unpacked no further than they promise and a log would go."""

from __future__ import annotations

import bz2
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from pivident.data.logs.source_files import HARMLESS_SIZE, refuse_bomb
from pivident.foundation.errors import FileFormatError
from pivident.foundation.extras import require

#: Most bytes of a chunk, unpacked.
MAX_CHUNK = 2**28

#: Most bytes of a single message that is packed by itself, unpacked.
MAX_PACKED_MESSAGE = 2**24

#: First bytes of a Zstandard frame.
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def unpacked(path: Path, kind: str, data: bytes, size: int | None, before: int) -> bytes:
    """Content of one chunk."""
    if kind in ("", "none"):
        return data
    most = MAX_PACKED_MESSAGE if size is None else size
    if most > MAX_CHUNK:
        raise FileFormatError(
            f"{path.name} has a chunk of {size} bytes, more than a recorder packs"
        )
    if before + most > HARMLESS_SIZE:
        refuse_bomb(path, before + (0 if size is None else size))
    decompressor = _decompressor(path, kind)
    try:
        if size is None:
            return _packed_message(path, data)
        content = decompressor.decompress(data, most + 1)
        while not decompressor.eof and len(content) <= most:
            more = decompressor.decompress(b"", most + 1 - len(content))
            if not more:
                break
            content += more
    except FileFormatError:
        raise
    except Exception as error:  # each library has an error of its own
        raise FileFormatError(
            f"{path.name} has a chunk that is no {kind} ({str(error)[:80]})", advice="copy it again"
        ) from error
    if len(content) != size or not decompressor.eof:
        raise FileFormatError(
            f"{path.name} has a {kind} chunk that holds more or less than it says"
        )
    return content


def _packed_message(path: Path, data: bytes) -> bytes:
    """A Zstandard frame that states its own size, as recorders write them: no more is unpacked."""
    zstd = _zstd()
    size = zstd.get_frame_info(data).decompressed_size
    if size is None or size > MAX_PACKED_MESSAGE:
        raise FileFormatError(f"{path.name} has a packed message of {size or 'unknown'} size")
    return zstd.ZstdDecompressor().decompress(data, size)


def unpack_file(path: Path, out: BinaryIO) -> None:
    """Unpack a Zstandard file as a whole."""
    written = 0
    for block in _blocks(path):
        written += len(block)
        if written > HARMLESS_SIZE:
            refuse_bomb(path, written)
        out.write(block)


def _blocks(path: Path, step: int = 2**22) -> Iterator[bytes]:
    """Content of a Zstandard file, block by block; parallel compressors write several frames."""
    decompressor = _decompressor(path, "zstd")
    try:
        with path.open("rb") as stream:
            data = b""
            while True:
                if decompressor.eof:
                    data = decompressor.unused_data or stream.read(step)
                    if not data:
                        return
                    decompressor = _decompressor(path, "zstd")
                elif decompressor.needs_input:
                    data = stream.read(step)
                    if not data:
                        raise EOFError("it ends too early")
                yield decompressor.decompress(data, step)
                data = b""
    except (FileFormatError, GeneratorExit):
        raise
    except Exception as error:
        raise FileFormatError(
            f"{path.name} is no whole zstd file ({str(error)[:80]})", advice="copy it again"
        ) from error


def _decompressor(path: Path, kind: str) -> Any:
    """A decompressor that stops at a length, as those of the standard library do."""
    if kind == "bz2":
        return bz2.BZ2Decompressor()
    if kind == "lz4":
        lz4 = require("lz4.frame", extra="bags", purpose=f"{path.name}, packed with lz4,")
        return lz4.LZ4FrameDecompressor()
    if kind == "zstd":
        return _zstd().ZstdDecompressor()
    raise FileFormatError(
        f"{path.name} is compressed with {kind[:20]!r}", advice="bz2, lz4 and zstd are read"
    )


def _zstd() -> Any:
    """Zstandard, which the standard library has from Python 3.14 on."""
    try:
        return import_module("compression.zstd")
    except ImportError:
        return import_module("backports.zstd")
