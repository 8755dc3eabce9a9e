"""A model as C99 that depends on ``math.h`` only: a source file and its header, no ``main``.

With NAME the name of the header, the functions are ``NAME_inverse_dynamics(q, dq, ddq, tau)``,
``NAME_gravity(q, g)``, ``NAME_mass_matrix(q, mass)`` and ``NAME_regressor(q, dq, ddq, phi)``, each
also with the suffix ``_samples`` for many states at once, and ``NAME_theta`` the parameters:
the torque is phi times theta. The numbers of the model are folded into the code.

Where the passive positions of a mechanism have no closed form, each has an argument ``posture``
before its result, from which the loops are followed; ``NAME_closed_posture`` is one to begin with.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.foundation.errors import ExportError
from pivident.foundation.text.identifiers import c_comment, identifier, one_line
from pivident.models.export.numpy_function import (
    NAMES,
    check_signals,
    header_lines,
    model_columns,
    model_programs,
    program_differences,
    verify_functions,
)
from pivident.models.export_format import Format
from pivident.models.exported import ExportedText, Verification
from pivident.models.runnable_model import RunnableModel

if TYPE_CHECKING:
    from pivident.models.symbolic.program import Program

#: Compiler flags of the check.
FLAGS = ("-std=c99", "-pedantic", "-O2")

#: Time limit of the compiler [s].
TIMEOUT = 120.0


def to_c(model: RunnableModel, name: str = "robot_model") -> ExportedText:
    """The model as a C file; its header is in ``further``.

    Args:
        model: the model.
        name: what header and functions are called; made an identifier where it is none.

    Returns:
        The source with its header, and what C cannot express.
    """
    from pivident.models.symbolic.print_c import c_header, c_source

    name, programs, own = identifier(name), model_programs(model), model_columns(model)
    theta = f"const double {name}_theta[{len(own.names)}]"
    about = "\n".join(
        c_comment(
            [
                *header_lines(model),
                f"Elements of {name}_theta:",
                *textwrap.wrap(" ".join(map(one_line, own.names)), 96),
                "Matrices are written row by row.",
            ]
        )
    )
    values = ",\n".join(f"    {value!r}" for value in own.values.tolist())
    source = [
        about,
        f'#include "{name}.h"',
        f"{theta} = {{\n{values}\n}};",
        c_source(programs, prefix=f"{name}_"),
    ]
    header = c_header(programs, prefix=f"{name}_").replace(
        "#include <stddef.h>\n", f"#include <stddef.h>\n\nextern {theta};\n", 1
    )
    return ExportedText(
        _bytes("\n\n".join(source)),
        program_differences(model),
        {f"{name}.h": _bytes(f"{about}\n{header}")},
    )


def c_compiler() -> str | None:
    """The C compiler of this machine: ``$CC``, cc, gcc or clang; None without one."""
    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        if name and (path := shutil.which(name)):
            return path
    return None


def verify_c(exported: ExportedText, model: RunnableModel) -> Verification:
    """Compile the file, load it, compare its functions with the model's.

    Args:
        exported: what `to_c` returned.
        model: the model.

    Returns:
        Largest difference of each function, or why the comparison was skipped.

    Raises:
        ExportError: it does not compile; the compiler's words.
    """
    compiler = c_compiler()
    if compiler is None:
        return Verification("C", skipped="there is no C compiler (cc, gcc, clang or $CC) here")
    program = f"{Path(compiler).name} {' '.join(FLAGS)}"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        try:
            library = compiled(exported, Path(folder), compiler)
        except (OSError, subprocess.SubprocessError) as error:
            said = getattr(error, "stderr", None) or str(error)
            said = " ".join(said.split())[:400]
            raise ExportError(f"the C file does not compile with {program}: {said}") from error
        return verify_functions(program, _results(exported, library, model), model)


def compiled(exported: ExportedText, folder: Path, compiler: str) -> ctypes.CDLL:
    """The exported file compiled in a folder and loaded as a library."""
    (header,) = exported.further
    source, library = folder / f"{Path(header).stem}.c", folder / f"{Path(header).stem}.so"
    source.write_bytes(exported.content)
    (folder / header).write_bytes(exported.further[header])
    subprocess.run(
        [compiler, *FLAGS, "-fPIC", "-shared", "-o", str(library), str(source), "-lm"],
        check=True,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=TIMEOUT,
    )
    return ctypes.CDLL(str(library))


def _results(
    exported: ExportedText, library: ctypes.CDLL, model: RunnableModel
) -> dict[str, np.ndarray]:
    """Results of the library's functions of many states for the signals of the check."""
    (header,) = exported.further
    stem = Path(header).stem
    signals = check_signals(model)

    def constant(name: str, count: int) -> np.ndarray:
        return np.array((ctypes.c_double * count).in_dll(library, f"{stem}_{name}"))

    found = {"THETA": constant("theta", len(model_columns(model).names))}
    for name, program in zip(NAMES, model_programs(model), strict=True):
        function = getattr(library, f"{stem}_{name}_samples")
        closing = program.closing
        start = None if closing is None else constant("closed_posture", len(closing.posture))
        found[name] = _of_arrays(function, program, start)(*signals[name])
    return found


def _of_arrays(
    function: Any, program: Program, start: np.ndarray | None
) -> Callable[..., np.ndarray]:
    """A function of many states as one of arrays.

    With a posture it is called for one state after the other, each of which begins from ``start``:
    states at random do not follow one another.
    """
    (output,) = program.outputs
    pointer = ctypes.POINTER(ctypes.c_double)
    function.restype = None

    def fill(signals: list[np.ndarray], result: np.ndarray) -> None:
        posture = [] if start is None else [start.copy()]
        places = [x.ctypes.data_as(pointer) for x in (*signals, *posture, result)]
        function(ctypes.c_size_t(len(result)), *places)

    def call(*signals: np.ndarray) -> np.ndarray:
        given = [np.ascontiguousarray(x, dtype=float) for x in signals]
        samples = len(given[0])
        result = np.empty((samples, *output.shape))
        step = samples if start is None else 1
        for k in range(0, samples, step):
            fill([x[k : k + step] for x in given], result[k : k + step])
        return result

    return call


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", errors="backslashreplace")


#: C99 without further libraries.
C = Format(
    "C99",
    ".c",
    lambda model, options: to_c(model, options.name),
    (lambda file, model, _: verify_c(file, model),),
)
