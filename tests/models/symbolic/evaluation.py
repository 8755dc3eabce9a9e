"""Programs evaluated by walking through their expressions: what generated code must agree with."""

import numpy as np

from pivident.dynamics.grouping.expressions import evaluate
from pivident.models.symbolic.program import Program


def evaluated(program: Program, *arguments: np.ndarray) -> tuple[np.ndarray, ...]:
    """Results of a program; its arguments as for `Program.function`."""
    values = {}
    signals = [x for x in program.inputs if x.symbols]
    given = [*signals, *([program.parameters] if program.parameters.symbols else [])]
    for argument, array in zip(given, arguments, strict=True):
        for k, s in enumerate(argument.symbols):
            values[s.name] = np.asarray(array)[..., k]
    states = np.broadcast_shapes(*(np.shape(a)[:-1] for a in arguments[: len(signals)]))
    flat = iter(evaluate(program.expressions, values))
    results = []
    for output in program.outputs:
        result = np.empty((*states, *output.shape))
        for place in np.ndindex(output.shape):
            result[(..., *place)] = next(flat)
        results.append(result)
    return tuple(results)
