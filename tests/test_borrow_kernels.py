"""Compiled kernels are taken over where nothing that they depend on has changed."""

import importlib.util

import pytest

from tests.conftest import REPOSITORY

TEXTS = {
    "calls": "from pivident.parts import called\n",
    "parts/__init__": "",
    "parts/called": "import pivident.constants\n",
    "constants": "G = 9.81\n",
    "alone": "x = 1\n",
}


@pytest.fixture(scope="module")
def tool():
    path = REPOSITORY / "tools" / "borrow_kernels.py"
    spec = importlib.util.spec_from_file_location("borrow_kernels", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def checkout(folder, texts):
    for name, text in texts.items():
        path = folder / "src" / "pivident" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def kernels(folder):
    return {path.name.split(".")[0] for path in folder.rglob("*.nb?")}


@pytest.fixture
def compiled(tmp_path):
    """A checkout whose every module has a kernel."""
    folder = checkout(tmp_path / "other", TEXTS)
    for path in list(folder.rglob("*.py")):
        cache = path.parent / "__pycache__"
        cache.mkdir(exist_ok=True)
        for ending in ("nbi", "1.nbc"):
            (cache / f"{path.stem}.kernel-1.py311.{ending}").write_text("compiled")
    return folder


def test_everything_is_taken_over_by_the_same_sources(tool, compiled, tmp_path):
    own = checkout(tmp_path / "own", TEXTS)
    assert tool.borrow(own, compiled) == 2 * len(TEXTS)
    assert kernels(own) == kernels(compiled)
    for path in compiled.rglob("*.py"):
        same = own / path.relative_to(compiled)
        assert same.stat().st_mtime_ns == path.stat().st_mtime_ns


@pytest.mark.parametrize(
    ("changed", "left"),
    [
        ("alone", {"calls", "__init__", "called", "constants"}),
        ("calls", {"alone", "__init__", "called", "constants"}),
        ("constants", {"alone", "__init__"}),
    ],
)
def test_what_depends_on_a_change_is_compiled_anew(tool, compiled, tmp_path, changed, left):
    own = checkout(tmp_path / "own", TEXTS | {changed: "y = 2\n" + TEXTS[changed]})
    tool.borrow(own, compiled)
    assert kernels(own) == left
