"""Compiled templates, kept beside their sources as Python keeps its modules.

A page consists of some forty templates, and to translate them takes as long as to fill them in. As
with modules, a file is found by a digest of its source and the versions of both languages, is
written whole or not at all, and whatever cannot be read is translated again.
"""

from __future__ import annotations

import marshal
from contextlib import suppress
from pathlib import Path

from jinja2 import BytecodeCache
from jinja2.bccache import Bucket, bc_magic

from pivident.foundation.files import keep

_FOLDER = Path(__file__).parent / "templates" / "__pycache__"


class TemplateCache(BytecodeCache):
    """Code of templates in a folder that may be missing, read-only or deleted at any time."""

    def __init__(self, folder: Path = _FOLDER) -> None:
        self.folder = folder

    def load_bytecode(self, bucket: Bucket) -> None:
        """Take the code that was kept, if there is any of this source."""
        with suppress(OSError, EOFError, ValueError, TypeError):
            code = marshal.loads(self._file(bucket).read_bytes())
            bucket.code = code if hasattr(code, "co_code") else None

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep the code, where Python itself may keep any."""
        keep(self._file(bucket), marshal.dumps(bucket.code))

    def _file(self, bucket: Bucket) -> Path:
        return self.folder / f"{bucket.key}.{bucket.checksum}.{bc_magic.hex()}"
