"""Folders of public records and reference values, for tests marked ``record``."""

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


def shared_folder(name: str) -> Path:
    root = Path(os.environ.get("PIVIDENT_DATA", REPOSITORY.parent / "shared"))
    folder = root / name
    if not folder.is_dir():
        pytest.skip(f"there is no {folder}; set PIVIDENT_DATA to the folder that holds {name}/")
    return folder


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Public records: ``$PIVIDENT_DATA/data`` or ``../shared/data``."""
    return shared_folder("data")


@pytest.fixture(scope="session")
def reference_dir() -> Path:
    """Reference values: ``$PIVIDENT_DATA/reference`` or ``../shared/reference``."""
    return shared_folder("reference")
