"""The command ``pivident compare``: results of methods, days or robots side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def compare(
    *results: Path,
    names: Annotated[str | None, Parameter(show_default=False)] = None,
    level: float = 0.05,
    out: Path | None = None,
) -> int:
    """Put results side by side, and list the parameters that differ significantly from the first.

    Parameters
    ----------
    results
        Folders that `pivident identify` wrote, or the files identification.json, consistent.json
        or model.json in them; a folder of several methods stands for all of them.
    names
        Names of the results, separated by commas. Default: the methods, or parts of the paths.
    level
        Probability of one false mark or more.
    out
        Folder for comparison.html, .csv, .json and .tex. Default: only the terminal.
    """
    import shutil
    import sys

    from pivident.foundation.files import check_output
    from pivident.studies.comparison.compare import compare as compare_results
    from pivident.studies.comparison.side_by_side import WIDTH, comparison_text

    if out is not None:
        check_output(out)
    found = compare_results(results, None if names is None else names.split(","), alpha=level)
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else WIDTH
    print(comparison_text(found, width))
    if out is not None:
        found.save(out)
        print(
            f"\nFiles: {out / 'comparison.html'}, comparison.csv, comparison.json, comparison.tex"
        )
    return 0
