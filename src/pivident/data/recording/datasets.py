"""Public records: where they are published, and how to have them here, checked by SHA-256.

A file is taken from the folder that the environment variable ``PIVIDENT_DATA`` names (with one
folder per data set in it or in its ``data`` folder), as published or gzipped; else from the cache;
else it is fetched from its public repository at a fixed commit.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pivident.data.logs.source_files import sha256
from pivident.foundation.errors import ChecksumMismatch, DatasetUnavailable, RecordingError

#: Environment variable that names a folder with the data sets.
ENVIRONMENT = "PIVIDENT_DATA"

_RAW = "https://raw.githubusercontent.com"
_FIGAROH = f"{_RAW}/thanhndv212/figaroh-examples/c0b5c7f0fda10078be55104f9ee76ac106b7a5ee/examples"
_EMPS = (
    f"{_RAW}/forgi86/sysid-neural-continuous/93afc131780fb1d5477472935a18ac8405683890"
    "/examples/EMPS/data"
)
_TIAGO_LOG = f"{_FIGAROH}/tiago/data/identification/dynamic"


@dataclass(frozen=True)
class PublicFile:
    """One file of a data set."""

    name: str  # file name as published
    sha256: str  # hash of the published file
    url: str | None = None  # where it is published, or None where only a local copy can be used
    gzipped: str | None = None  # hash of the copy ``<name>.gz``, if there is one

    def forms(self) -> Iterator[tuple[str, str]]:
        """File name and hash of each form in which the file may lie here."""
        yield self.name, self.sha256
        if self.gzipped is not None:
            yield f"{self.name}.gz", self.gzipped


@dataclass(frozen=True)
class Dataset:
    """One public record."""

    title: str  # what it is, one line
    licence: str  # terms of the repository that publishes it
    cite: str  # what to cite
    files: dict[str, PublicFile]  # its files by the name of what they hold


DATASETS = {
    "staubli_tx40": Dataset(
        title="Stäubli TX40, 6 axes, 5 kHz, 9 s, motor positions and torques",
        licence="Apache-2.0 (FIGAROH examples); record by IRCCyN Nantes",
        cite="Gautier, Janot, Vandanjon, IEEE TCST 21(2), 2013; Nguyen et al., Humanoids 2023",
        files={
            "q": PublicFile(
                "pos_read_data.csv",
                "5cc1cecc1024ef0e331d0caba06f689456ab789ec3f1e904599c0a8be5c27bc8",
                f"{_FIGAROH}/staubli_TX40/data/pos_read_data.csv",
                "2b354b659fa34f5daa7e091d9c8d007ae12922a3a86ef24523867a1605de296b",
            ),
            "tau": PublicFile(
                "curr_data.csv",
                "f4592f4ba4db42f5d7625688986be25b575ca34d0504b27979ca6b0276bd3af9",
                f"{_FIGAROH}/staubli_TX40/data/curr_data.csv",
                "e5b28cdb5d2966f6cbcc739bf7e7492357f2ea7791a4d72b184e499bf9103e3b",
            ),
            "urdf": PublicFile(
                "tx40_mdh_modified.urdf",
                "3d00cbd46279c915d594b1bb4610dbac78d1e99ed27f95de70984bde13486074",
                f"{_FIGAROH}/staubli_TX40/urdf/tx40_mdh_modified.urdf",
            ),
        },
    ),
    "emps": Dataset(
        title="EMPS, 1 axis, 1 kHz, 25 s, with reference and known controller; two runs",
        licence="MIT and Apache-2.0 (repositories that host it); benchmark by its authors",
        cite="Janot, Gautier, Brunot, Data Set and Reference Models of EMPS, Eindhoven 2019",
        files={
            "estimation": PublicFile(
                "DATA_EMPS.mat",
                "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
                f"{_EMPS}/DATA_EMPS.mat",
            ),
            "pulses": PublicFile(
                "DATA_EMPS_PULSES.mat",
                "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
                f"{_EMPS}/DATA_EMPS_PULSES.mat",
            ),
        },
    ),
    "kuka_kr300": Dataset(
        title="KUKA KR300 R2500 ultra, 6 axes, 250 Hz, 10 s, with reference; two motions",
        licence="MIT, © 2021 Jonas Weigand",
        cite="Weigand, Ulmen, Janot, Ruskowski, github.com/JonasWeigand/Robot_Identification",
        # The repository publishes these arrays inside MATLAB structs together with objects of a
        # toolbox; the .npz files are a conversion that nobody publishes.
        files={
            "A": PublicFile(
                "kr300_traj_A.npz",
                "66ffc73864df4a4ab6cb7fc60675ae353a499b5e7c184e9488360f14c682266c",
            ),
            "B": PublicFile(
                "kr300_traj_B.npz",
                "181f2328dc7734eb11138647390cd75f2b73cb32384435a5b0cf50e053ffc548",
            ),
        },
    ),
    "tiago": Dataset(
        title="PAL TIAGo, torso and 7-axis arm, about 100 Hz, 80 s, raw effort",
        licence="Apache-2.0 (FIGAROH examples)",
        cite="Nguyen et al., FIGAROH, Humanoids 2023",
        files={
            "q": PublicFile(
                "tiago_position.csv",
                "4297a60d434ee89f1f424ad0da8ec65bc00072ac57eb06b94966c0819fc2786d",
                f"{_TIAGO_LOG}/tiago_position.csv",
                "70e6515beeed97faaecf6642d9420a0915e74c3d23edc7302612239f9bb5e9d2",
            ),
            "dq": PublicFile(
                "tiago_velocity.csv",
                "269f681ca7a9511ac1698bf027ddf601e3fdb49d7d397af4810ec839f136cd69",
                f"{_TIAGO_LOG}/tiago_velocity.csv",
                "794679afec8fc549c8361c147a05c39060a54f8de27c6ac57341bcba770d249f",
            ),
            "tau": PublicFile(
                "tiago_effort.csv",
                "12c635987705efade603426a600f5b315add7f580c720a4b84609dadb9d0a2e9",
                f"{_TIAGO_LOG}/tiago_effort.csv",
                "1064d9fc9ad38f5112ae8aa147e59133ea840e2cc7d1cb7baf39f546ed68d9f0",
            ),
            "urdf": PublicFile(
                "tiago_48_hey5.urdf",
                "09836094b70a3a5f4d7f5a9b94a58b8b1d381a332082761f049f0639db9f4581",
                f"{_FIGAROH}/tiago/urdf/tiago_48_hey5.urdf",
                "64196f18c3952aa89d083829307f3482991c5b5a310ab1f3d17199bd2e6c4a04",
            ),
        },
    ),
}


def describe(name: str) -> str:
    """What a data set is, its terms, what to cite and its files, as a few lines of text."""
    dataset = _dataset(name)
    files = ", ".join(f"{key}: {file.name}" for key, file in dataset.files.items())
    return f"{dataset.title}\nLicence: {dataset.licence}\nCite: {dataset.cite}\nFiles: {files}"


def dataset_files(name: str, *keys: str) -> dict[str, Path]:
    """Files of a data set that are here already."""
    found = {}
    for key, file in _wanted(name, keys).items():
        path = _local(name, file)
        if path is None:
            raise DatasetUnavailable(name, file.name, "it is neither in PIVIDENT_DATA nor cached")
        found[key] = path
    return found


def fetch(name: str, *keys: str) -> dict[str, Path]:
    """Files of a data set, fetched from their public repository if they are not here."""
    return {
        key: _local(name, file) or _download(name, file)
        for key, file in _wanted(name, keys).items()
    }


def _dataset(name: str) -> Dataset:
    """The data set of that name."""
    if name not in DATASETS:
        raise RecordingError(f"no data set {name!r}", advice=f"there are {', '.join(DATASETS)}")
    return DATASETS[name]


def _wanted(name: str, keys: tuple[str, ...]) -> dict[str, PublicFile]:
    """Entries of the files wanted."""
    files = _dataset(name).files
    for key in keys:
        if key not in files:
            raise RecordingError(
                f"data set {name!r} has no file {key!r}", advice=f"it has {', '.join(files)}"
            )
    return {key: files[key] for key in keys or files}


def _local(name: str, file: PublicFile) -> Path | None:
    """The file where it lies already: in the folder the user names, or in the cache."""
    given = os.environ.get(ENVIRONMENT)
    for folder in (Path(given) / name, Path(given) / "data" / name) if given else ():
        for form, expected in file.forms():
            path = folder / form
            if path.is_file():
                return _checked(path, expected)
    cached = _cache(name) / file.name
    # A broken file in the cache is ours to replace, one in the user's folder is not.
    return cached if cached.is_file() and sha256(cached) == file.sha256 else None


def _checked(path: Path, expected: str) -> Path:
    """The path, once its content is known to be the published one."""
    found = sha256(path)
    if found != expected:
        raise ChecksumMismatch(str(path), found, expected)
    return path


def _cache(name: str) -> Path:
    """Folder of the cache for one data set."""
    import pooch

    return Path(pooch.os_cache("pivident")) / name


def _download(name: str, file: PublicFile) -> Path:
    """Fetch a file into the cache."""
    import pooch

    if file.url is None:
        raise DatasetUnavailable(name, file.name, "it is not published in this form")
    try:
        path = pooch.retrieve(
            file.url, known_hash=f"sha256:{file.sha256}", fname=file.name, path=_cache(name)
        )
    except ValueError as error:
        raise DatasetUnavailable(
            name, file.name, f"{file.url} no longer holds the published file ({error})"
        ) from error
    except OSError as error:
        reason = f"{file.url} cannot be reached ({type(error).__name__})"
        raise DatasetUnavailable(name, file.name, reason) from error
    return Path(path)
