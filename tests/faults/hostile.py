"""Files made to harm, as the tests of one format after the other write them."""

import struct
import zipfile
from pathlib import Path

STUDY = """
robot = "planar_2r"
[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]
[noise]
torque = 0.05
"""


def written(tmp_path: Path, name: str, content: str | bytes) -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def npy(header: bytes, body: bytes = b"", version: tuple[int, int] = (1, 0)) -> bytes:
    """An array as NumPy stores it, with any header."""
    length = struct.pack("<H" if version == (1, 0) else "<I", len(header))
    return b"\x93NUMPY" + bytes(version) + length + header + body


def archive(tmp_path: Path, **members: bytes) -> Path:
    """An archive of arrays; ``__`` in a name stands for a slash."""
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name.replace("__", "/") + ".npy", content)
    return path
