"""The command ``pivident datasets``: public records, listed or fetched."""

from __future__ import annotations

import os

from cyclopts import App

from pivident.app.cli.console import DONE, Progress
from pivident.foundation.errors import DatasetUnavailable, PividentError

app = App(
    name="datasets",
    help="Public records: list them, or fetch one.",
    group_commands="Commands",
    suppress_keyboard_interrupt=False,
)


@app.default
def datasets() -> int:
    """List the public records, and whether they are here."""
    from pivident.data.recording.datasets import (
        DATASETS,
        ENVIRONMENT,
        dataset_files,
        describe,
    )

    for name, dataset in DATASETS.items():
        published = all(file.url for file in dataset.files.values())
        try:
            place = f"here: {next(iter(dataset_files(name).values())).parent}"
        except DatasetUnavailable as error:
            way = f"pivident datasets fetch {name}" if published else "not published in this form"
            place = f"not here ({error.file}): {way}"
        except PividentError as error:
            place = f"not usable: {error}"
        print("\n  ".join([name, *describe(name).splitlines(), place]), end="\n\n")
    print(f"{ENVIRONMENT} = {os.environ.get(ENVIRONMENT, 'not set')}")
    return DONE


@app.command
def fetch(name: str, /) -> int:
    """Fetch a public record, check it, and print where its files are.

    Parameters
    ----------
    name
        Name of the record.
    """
    from pivident.data.recording.datasets import fetch as fetch_files

    with Progress() as progress:
        progress.say(f"fetching {name}")
        files = fetch_files(name)
    for path in files.values():
        print(path)
    return DONE
