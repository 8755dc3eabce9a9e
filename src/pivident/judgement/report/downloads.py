"""Files that a page carries inside itself: parameters as CSV, JSON and LaTeX, signals as CSV."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.identification import FittedRecording, Identification
from pivident.estimation.identification_file import to_csv, to_json
from pivident.estimation.parameter_rows import parameter_rows
from pivident.foundation.document.table import Column, Table
from pivident.foundation.text.identifiers import identifiers, latex_name, latex_text, one_line
from pivident.foundation.text.numbers import latex_number, latex_unit

#: Numbers of all tables of signals together; one takes 9 bytes of the page.
MAX_NUMBERS = 30_000

#: A part of a file's name is not longer than this.
MAX_STEM = 60

#: Signals of a joint in a table: heading (of a torque {m}, measured or computed), unit (of the
#: position {p}, of the torque {t}), attribute.
SIGNALS = (
    ("measured position", "{p}", "q_measured"),
    ("position", "{p}", "q"),
    ("speed", "{p}/s", "dq"),
    ("acceleration", "{p}/s²", "ddq"),
    ("{m} torque", "{t}", "tau"),
    ("model torque", "{t}", "tau_model"),
)


@dataclass(frozen=True)
class Download:
    """A file inside the page."""

    name: str  # file name: letters, digits, underscores and one full stop
    words: str  # what it is
    media_type: str  # such as ``text/csv``
    text: str
    holder: str  # identifier of the element on the page that holds it
    method: int  # index of the method that it belongs to

    @property
    def size(self) -> str:
        """Size in kB."""
        return f"{max(1, round(len(self.text.encode('utf-8', 'replace')) / 1000))} kB"


def downloads(
    identifications: Sequence[Identification],
    labels: Sequence[str],
    recordings: Sequence[FittedRecording],
    best: int,
) -> tuple[Download, ...]:
    """Parameters of every method; the whole identification and the signals of one."""
    files: list[Download] = []
    labelled = zip(identifications, labels, strict=True)
    stems = _stems([f"{i.robot.name} {label}" for i, label in labelled])
    for k, (identification, stem) in enumerate(zip(identifications, stems, strict=True)):
        for ending, words, media_type, write in (
            ("parameters.csv", "parameters, CSV", "text/csv", to_csv),
            ("parameters.tex", "parameters, LaTeX", "application/x-tex", to_latex),
            ("identification.json", "identification, JSON", "application/json", to_json),
        ):
            if write is to_json and k != best:
                continue
            text, holder = write(identification), f"file-{len(files) + 1}"
            files.append(Download(f"{stem}_{ending}", words, media_type, text, holder, k))
    tables = _stems([f"{recording.name} {stems[best]}" for recording in recordings])
    for recording, stem in zip(recordings, tables, strict=True):
        of = f" of {one_line(recording.name)}" if len(recordings) > 1 else ""
        step = signal_step(identifications[best], recordings)
        every = "every sample" if step == 1 else f"one sample of {step}"
        files.append(
            Download(
                f"{stem}_signals.csv",
                f"signals{of}, {every}, CSV",
                "text/csv",
                signals_csv(identifications[best], recording, step),
                f"file-{len(files) + 1}",
                best,
            )
        )
    return tuple(files)


def signal_step(identification: Identification, recordings: Sequence[FittedRecording]) -> int:
    """One sample out of how many is kept, so that all tables together stay small."""
    columns = 1 + (len(SIGNALS) + 1) * identification.robot.size
    rows = sum(len(recording.t) for recording in recordings)
    return max(1, math.ceil(rows * columns / MAX_NUMBERS))


def signals_csv(identification: Identification, recording: FittedRecording, step: int = 1) -> str:
    """Signals as the estimator saw them, one row per instant; numbers not finite are left empty."""
    origin = "measured" if recording.torque_source == "measured" else "commanded"
    # The clock may count from 1970: six digits do not distinguish its samples.
    columns = {"time [s]": Column(recording.t[::step], file_format="%.15g")}
    for j, (joint, fit) in enumerate(
        zip(identification.robot.joints, identification.joints, strict=True)
    ):
        for words, unit, attribute in (*SIGNALS, ("used", "0 or 1", "used")):
            shown = unit.format(p=joint.position_unit, t=fit.torque_unit)
            values = np.asarray(getattr(recording, attribute), dtype=float)[::step, j]
            head = f"{joint.name} {words.format(m=origin)} [{shown}]"
            columns[head] = Column(values, file_format="%.6g")
    return Table("signals", columns).to_csv()


def to_latex(identification: Identification) -> str:
    r"""The estimates as a table for LaTeX (booktabs, longtable), to be read in with ``\input``."""
    robot, method = (one_line(text) for text in (identification.robot.name, identification.method))
    return "\n".join(
        [
            f"% Base parameters of {robot}, {method}.",
            r"% In the preamble: \usepackage{amsmath,booktabs,longtable}",
            r"\begin{longtable}{lrrrlp{0.4\linewidth}}",
            rf"\caption{{Base parameters of {latex_text(robot)}, {latex_text(method)}.}}\\",
            r"\toprule",
            r"Parameter & Estimate & $\pm 2\sigma$ & $\sigma/|\theta|$ [\%] & Unit & Group \\",
            r"\midrule",
            r"\endhead",
            *_latex_rows(identification),
            r"\bottomrule",
            r"\end{longtable}",
            "",
        ]
    )


def _latex_rows(identification: Identification) -> Iterator[str]:
    for row in parameter_rows(identification):
        relative = f"{row.relative_std:.2g}" if math.isfinite(row.relative_std) else "–"
        cells = (
            f"${latex_name(one_line(row.name))}$",
            *map(latex_number, row.value_and_spread),
            latex_number(relative),
            latex_unit(row.unit),
            latex_text(one_line(row.expression)),
        )
        yield " & ".join(cells) + r" \\"


def _stems(names: Sequence[str]) -> list[str]:
    """Names of files without their ending, all different, that no file system stumbles over."""
    return identifiers([name[:MAX_STEM] for name in names])
