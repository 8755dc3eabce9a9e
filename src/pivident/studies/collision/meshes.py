"""Meshes of a URDF: where their files are, and their vertices.

A mesh is looked for beside the URDF and never further away than its package: ``package://name/…``
below the nearest folder ``name`` that holds the URDF or stands beside one of the folders above it,
at most `MAX_LEVELS` up, or below one of those folders itself where the package's has another name;
any other path from the URDF's folder, at most `MAX_CLIMB` folders up. Links inside these folders
are followed, as build tools of ROS make them.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.extras import require
from pivident.foundation.files import regular_file

#: Most folders above that of the URDF in which a mesh or its package is looked for.
MAX_LEVELS = 5

#: Most folders above that of the URDF that a path without a package may climb.
MAX_CLIMB = 2

#: Largest mesh file that is read [bytes].
MAX_MESH_SIZE = 64 * 2**20

#: What the loader reads and files of collision shapes are.
SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".off")


class MissingMesh(RobotDescriptionError):
    """A mesh that a URDF names is not there, as in most public URDFs without their package."""


@dataclass(frozen=True)
class MeshFiles:
    """Finds the meshes that a URDF names.

    Attributes:
        urdf: path of the URDF; empty where its text did not come from a file.
    """

    urdf: str

    def found(self, reference: str) -> Path:
        """The file of a mesh.

        Args:
            reference: the mesh as the URDF names it.

        Returns:
            Its path; the file exists.

        Raises:
            MissingMesh: there is no such file.
            RobotDescriptionError: it cannot be read, or it lies where none is looked for.
        """
        if not self.urdf:
            raise RobotDescriptionError(
                f"mesh {reference!r}: the robot was not read from a file, so its place is unknown",
                advice="read the URDF from its file",
            )
        scheme, separator, rest = reference.partition("://")
        if not separator:
            path = self._beside(reference, reference)
        elif scheme in ("package", "model"):
            path = self._in_package(reference, rest)
        else:
            raise RobotDescriptionError(
                f"mesh {reference!r}: {scheme}:// is not read",
                advice="write package://name/… or a path from the folder of the URDF",
            )
        if path.suffix.lower() not in SUFFIXES:
            raise RobotDescriptionError(
                f"mesh {reference!r}: {path.suffix or 'a file without ending'} is not read",
                advice=f"convert it to one of {', '.join(SUFFIXES)}",
            )
        try:
            size = regular_file(path).stat().st_size
        except OSError as error:
            gone = isinstance(error, FileNotFoundError)
            raise (MissingMesh if gone else RobotDescriptionError)(
                f"mesh {reference!r}: {path} cannot be read ({error.strerror})",
                advice="put it there",
            ) from error
        if size > MAX_MESH_SIZE:
            raise RobotDescriptionError(
                f"mesh {reference!r}: {path} has {size / 2**20:.0f} MiB, {MAX_MESH_SIZE // 2**20} "
                "MiB are read",
                advice="use a simplified collision mesh",
            )
        return path

    def _beside(self, path: str, reference: str) -> Path:
        folder = Path(self.urdf).parent
        whole = Path(os.path.normpath(folder / path))
        highest = [folder, *folder.parents][: MAX_CLIMB + 1][-1]
        if not whole.is_relative_to(highest):
            raise RobotDescriptionError(
                f"mesh {reference!r} is not below {highest}, where the meshes of this URDF are "
                "looked for",
                advice="move it beside the URDF and name it by a path from there",
            )
        return whole

    def _in_package(self, reference: str, rest: str) -> Path:
        package, _, inside = rest.partition("/")
        parts = PurePosixPath(inside).parts
        if not package.strip(".") or not parts or ".." in parts or inside.startswith("/"):
            raise RobotDescriptionError(
                f"mesh {reference!r} leads out of its package",
                advice="write package://name/path without '..'",
            )
        folders = list(Path(self.urdf).parents)[: MAX_LEVELS + 1]
        for folder in folders:
            for candidate in (folder, folder / package):
                if candidate.name == package and (candidate / inside).exists():
                    return candidate / inside
        for folder in folders:
            if (folder / inside).exists():
                return folder / inside
        raise MissingMesh(
            f"mesh {reference!r} is in no folder {package!r} that holds the URDF or stands beside "
            f"a folder above it, up to {folders[-1]}",
            advice=f"put the package {package!r} there",
        )


def load_mesh(path: Path, scale: np.ndarray) -> Any:
    """A mesh as the library coal loads it.

    Args:
        path: the file.
        scale: factors along its axes, shape (3,).

    Returns:
        A ``coal.BVHModelBase``.

    Raises:
        RobotDescriptionError: the file is no mesh, or it is empty.
        MissingExtra: coal is not installed.
    """
    coal = require("coal", extra="collision", purpose="a robot with meshes")
    try:
        mesh = coal.MeshLoader(coal.BV_OBBRSS).load(str(path), np.asarray(scale, dtype=float))
    except (ValueError, RuntimeError) as error:
        reason = next((line for line in str(error).splitlines()[4:] if line.strip()), "unreadable")
        raise RobotDescriptionError(f"{path} is no mesh that can be read ({reason})") from error
    vertices = mesh_vertices(mesh)
    if not len(vertices) or not np.isfinite(vertices).all():
        raise RobotDescriptionError(f"{path} has no vertices, or one that is not finite")
    return mesh


def mesh_vertices(mesh: Any) -> np.ndarray:
    """Vertices of a loaded mesh [m], shape (vertices, 3)."""
    return np.array(mesh.vertices(), dtype=float).reshape(-1, 3)


def mesh_triangles(mesh: Any) -> np.ndarray:
    """Indices of the corners of a loaded mesh's triangles, shape (triangles, 3)."""
    rows = (mesh.tri_indices(i) for i in range(mesh.num_tris))
    return np.array([[row[k] for k in range(3)] for row in rows], dtype=np.int64).reshape(-1, 3)
