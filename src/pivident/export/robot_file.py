"""A robot description in the format of simulators."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

from pivident.errors import ExportError
from pivident.export.joint_side import JointProperty
from pivident.models.exported import ExportedText
from pivident.robot.urdf_xml import GZIP_MAGIC, MAXIMUM_SIZE


@dataclass(frozen=True)
class RobotFile(ExportedText):
    """A robot in the format of simulators: ``urdf``, ``mjcf`` or ``sdf``.

    ``left_out`` are the parts of parameters that are not in the file, by name, in the parameters'
    units, ``supported`` the properties of joints that the format has. With Φ the observation
    matrix, the model's torque is what the file's readers compute plus Φ · left_out; dry friction is
    in the file with a sharp sign.
    """

    format: str = "urdf"
    left_out: Mapping[str, float] = field(default_factory=dict)
    supported: frozenset[JointProperty] = frozenset()

    @property
    def text(self) -> str:
        """The file as text; bytes that are not UTF-8 become escapes."""
        return self.content.decode("utf-8", errors="backslashreplace")


def plain_content(content: bytes) -> bytes:
    """A file's bytes, decompressed if they are gzip."""
    if content[: len(GZIP_MAGIC)] == GZIP_MAGIC:
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(content)) as file:
                content = file.read(MAXIMUM_SIZE + 1)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise ExportError(
                f"the original file is damaged gzip ({error})", advice="fetch or compress it again"
            ) from error
    if len(content) > MAXIMUM_SIZE:
        raise ExportError(
            f"the original file is larger than {MAXIMUM_SIZE // 2**20} MiB",
            advice="this is not a robot description",
        )
    return content
