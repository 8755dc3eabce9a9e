"""Logs as text to begin with, and a grammar that grows tables, or nearly tables."""

from __future__ import annotations

import io
import random
from functools import cache

import numpy as np

from fuzzing.mutations import NUMBERS, TEXTS

LOG = "time,q1,q2,r1,r2,tau1,tau2"


@cache
def log_table(samples: int = 60) -> np.ndarray:
    """A short log: time, two positions, two references, two torques."""
    t = np.arange(samples) / 1000.0
    waves = [np.sin((3 + k) * 20 * t + k) for k in range(6)]
    return np.column_stack([t, *waves])


def log_csv() -> bytes:
    """The log as CSV."""
    stream = io.StringIO()
    np.savetxt(stream, log_table(), fmt="%.6g", delimiter=",", header=LOG, comments="")
    return stream.getvalue().encode()


CSV_CHUNKS = (
    "\0", "\ufeff", '"', '""', "'", ";", "\t", ",", "\n", "\r", "\r\n", "#", "\n\n\n", "," * 5000,
    "\n" * 3000, '"' + "a" * 200000, "1,2,3\n" * 50, "nan", "inf", "1e400", "1,5", "=1+1",
    "\x1b[2J", "\u2028", "\x85", "\x0b", "\x0c", "\x1c", "a" * 70000, '"a\nb"', "0x10", "1_000",
    "١", "−1",
)  # fmt: skip


def grown_csv(rng: random.Random) -> bytes:
    """A table, or nearly one, of any width."""
    separator = rng.choice(",;\t,,")
    columns = rng.choice((1, 2, 3, 7, 7, 40))
    cell = (
        (lambda: rng.choice(TEXTS + NUMBERS))
        if rng.random() < 0.3
        else (lambda: f"{rng.gauss(0, 1):.4g}")
    )
    rows = []
    if rng.random() < 0.8:
        rows.append(
            separator.join(
                rng.choice((f"c{k}", rng.choice(TEXTS), "a")) if rng.random() < 0.1 else f"c{k}"
                for k in range(columns)
            )
        )
    for _ in range(rng.randrange(20)):
        width = columns if rng.random() < 0.98 else rng.randrange(9)
        rows.append(separator.join(cell() for _ in range(width)))
    end = rng.choice(("\n", "\n", "\n", "\r\n", "\r"))
    return (
        rng.choice(("", "", "\ufeff", "# a comment\n")) + end.join(rows) + rng.choice(("", end))
    ).encode()


def habit_seeds() -> tuple[bytes, ...]:
    """Tables as controllers write them: blanks, decimal commas, titles, preambles, UTF-16."""
    numbers = "".join(f"{k}\t{k / 8:.3f}\t{k}\t-2\r\n" for k in range(9))
    scope = "Name\tScope\r\nFile\tC:/a.svdx\r\n\r\nName\tq1\tName\ttau1\r\nUnit\tdeg\tUnit\tNm\r\n"
    trace = "Trace;KR C4, 12\nRate;250\n\nZeit;A1;M1\ns;Grad;Nm\n" + 9 * "0,004;1,5;-2\n"
    german = "sep=;\r\nZeit;A1_Ist;A2_Ist\r\ns;Grad;Grad\r\n0,004;1,5;-2\r\n0,008;1,6;-3\r\n"
    return (
        b"timestamp actual_q_0 actual_q_1\n0.002 1.5  2\n0.004 1.6 3\n",
        german.encode(),
        german.encode("utf-16"),
        f"{scope}\r\n{numbers}EOF\r\n".encode(),
        trace.encode("latin-1"),
        b"%time,field.position0\n1700000000000000000,0.5\n1700000000002000000,0.6\n",
    )
