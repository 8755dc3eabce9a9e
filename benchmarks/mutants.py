"""Mutants of core modules: small faults, one at a time, of which the tests should notice each.

Of each module a fixed number of places is drawn by a seed; there a comparison is turned, a sum
becomes a difference, a product a quotient, a number is made half as large again, a condition is
negated, or a statement is left out. The tests that are named beside the module are run on a copy
of the source with this one change. Printed are the survivors.

    python -m benchmarks.mutants [--each 8] [--seed 0] [--only MODULE …]
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

#: Core modules, and the tests of each.
MODULES = {
    "estimation/normal_equations.py": ["tests/estimation/test_normal_equations.py"],
    "estimation/instrumental_variables.py": [
        "tests/estimation/test_instrumental_methods.py",
        "tests/studies/friction_laws/test_friction_laws.py",
        "tests/estimation/test_instrument_kinds.py",
        "tests/estimation/test_simulated_tx40.py",
    ],
    "estimation/prefiltered_iv.py": [
        "tests/estimation/test_instrumental_methods.py",
        "tests/experiment/test_experiment.py",
        "tests/estimation/test_problem.py",
        "tests/estimation/test_instrument_kinds.py",
        "tests/estimation/test_simulated_tx40.py",
    ],
    "dynamics/base_parameters.py": ["tests/dynamics/test_base_parameters.py"],
    "dynamics/regressor.py": [
        "tests/dynamics/test_regressor.py",
        "tests/dynamics/test_friction_columns.py",
    ],
    "judgement/audit/delay.py": [
        "tests/judgement/audit/test_delay.py",
        "tests/judgement/audit/test_sticking.py",
        "tests/judgement/audit/test_planted_faults.py",
        "tests/judgement/audit/test_recording_audit.py",
    ],
    "judgement/audit/order.py": [
        "tests/judgement/audit/test_planted_faults.py",
        "tests/app/studio/test_fixes.py",
    ],
    "judgement/audit/power.py": [
        "tests/judgement/audit/test_power.py",
        "tests/judgement/audit/test_planted_faults.py",
        "tests/judgement/audit/test_slide_weight.py",
    ],
    "experiment/repairs.py": ["tests/experiment/test_repairs.py", "tests/app/studio/test_fixes.py"],
    "foundation/text/repair.py": [
        "tests/experiment/test_repairs.py",
        "tests/app/studio/test_fixes.py",
    ],
}

TURNED = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq,
          ast.NotEq: ast.Eq, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot,
          ast.IsNot: ast.Is}  # fmt: skip
OTHER = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}


def places(tree: ast.Module) -> Iterator[ast.AST]:
    """Nodes that can be changed, inside of functions, without docstrings and annotations."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    statements = [statement for function in functions for statement in function.body]
    nodes = (node for statement in statements for node in ast.walk(statement))
    for node in {id(node): node for node in nodes}.values():  # nested functions are met twice
        number = isinstance(node, ast.Constant) and type(node.value) in (int, float)
        turned = isinstance(node, ast.Compare) and type(node.ops[0]) in TURNED
        other = isinstance(node, ast.BinOp) and type(node.op) in OTHER
        if number or turned or other or isinstance(node, (ast.If, ast.IfExp, ast.AugAssign)):
            yield node


def change(node: ast.AST) -> str:
    """Change a node in place; what was done, in words."""
    before = ast.unparse(node).partition("\n")[0]
    if isinstance(node, ast.Compare):
        node.ops[0] = TURNED[type(node.ops[0])]()
    elif isinstance(node, ast.BinOp):
        node.op = OTHER[type(node.op)]()
    elif isinstance(node, ast.Constant):
        node.value = node.value * 1.5 or 1.0 if isinstance(node.value, float) else node.value + 1
    elif isinstance(node, (ast.If, ast.IfExp)):
        node.test = ast.UnaryOp(ast.Not(), node.test)
    elif isinstance(node, ast.AugAssign):
        node.value = ast.BinOp(ast.Constant(0), ast.Mult(), node.value)
    return f"{before}  ->  {ast.unparse(node).partition(chr(10))[0]}"


def mutants(path: Path, each: int, seed: int) -> Iterator[tuple[int, str, str]]:
    """Line, description and text of some mutants of a module."""
    tree = ast.parse(path.read_text("utf-8"))
    count = len(list(places(tree)))
    for number in sorted(random.Random(seed).sample(range(count), min(each, count))):
        mutant = copy.deepcopy(tree)
        node = list(places(mutant))[number]
        line = node.lineno
        yield line, change(node), ast.unparse(ast.fix_missing_locations(mutant))


def is_noticed(folder: Path, tests: list[str]) -> bool:
    """Whether any test fails on the source in a folder; one that does not end counts."""
    environment = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider"]
    try:
        done = subprocess.run(
            [*command, *tests], cwd=ROOT, env=environment, capture_output=True, timeout=600
        )
    except subprocess.TimeoutExpired:
        return True
    return done.returncode != 0


def main() -> None:
    """Print the survivors of every module, and how many were noticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=list(MODULES))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch) / "src"
        shutil.copytree(ROOT / "src", source)
        for module in options.only:
            path, tests = source / "pivident" / module, MODULES[module]
            right = path.read_text("utf-8")
            assert not is_noticed(source, tests), f"the tests of {module} fail without a mutant"
            noticed, tried = 0, 0
            for line, words, text in mutants(path, options.each, options.seed):
                path.write_text(text, "utf-8")
                tried += 1
                if is_noticed(source, tests):
                    noticed += 1
                else:
                    print(f"    survives: {module}:{line}: {words}", flush=True)
            path.write_text(right, "utf-8")
            print(f"{module}: {noticed} of {tried} noticed", flush=True)


if __name__ == "__main__":
    main()
