"""Every block of every page is run, in order, or says why not; see ``page_blocks.py``."""

import importlib.util
import linecache
import os
import runpy
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from pivident.app.cli import main
from pivident.foundation.errors import DatasetUnavailable
from tests.docs import preparations
from tests.docs.page_blocks import (
    DOCS,
    MARK,
    Block,
    blocks_of,
    commands_of,
    same_output,
    same_word,
)

REPOSITORY = DOCS.parent
RUN = ("python", "console", "file", "toml", "output")


@cache
def page_blocks(page: str) -> list[Block]:
    return [b for b in blocks_of((DOCS / page).read_text("utf-8"), page) if b.kind in RUN]


def all_blocks() -> list:
    params = []
    pages = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))
    for page in pages:
        for block in page_blocks(page):
            record = any(need.startswith("record ") for need in block.all_marks("needs"))
            marks = [pytest.mark.record] if record else []
            params.append(pytest.param(block, id=str(block), marks=marks))
    return params


class PageRun:
    """A page that is being run: its folder, the names of its Python, what was printed last."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.names: dict = {"__name__": "__main__"}
        self.printed = ""
        self.done: set[int] = set()
        self.failed: Block | None = None


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    started: dict[str, PageRun] = {}

    def run_of(page: str) -> PageRun:
        if page not in started:
            started[page] = PageRun(tmp_path_factory.mktemp("page"))
        return started[page]

    return run_of


@pytest.mark.parametrize("block", all_blocks())
def test_block(block, runs, request, monkeypatch, capsys):
    state = runs(block.page)
    monkeypatch.chdir(state.folder)
    monkeypatch.syspath_prepend(state.folder)
    if state.failed:
        pytest.skip(f"the block at {state.failed} failed before it")
    for earlier in page_blocks(block.page):  # when this block is asked for alone
        if earlier.line < block.line and earlier.line not in state.done and not left_out(earlier):
            run_block(earlier, state, capsys, request)
    if (other := block.mark("run by")) is not None:
        check_other_test(block, other)
    elif (reason := block.mark("skip")) is not None:
        assert len(reason.split()) >= 3, f"{block}: say why it is skipped"
        pytest.skip(f"{block}: {reason}")
    else:
        state.failed = block
        run_block(block, state, capsys, request)
        state.failed = None


def left_out(block: Block) -> bool:
    return block.mark("skip") is not None or block.mark("run by") is not None


def run_block(block: Block, state: PageRun, capsys, request) -> None:
    state.done.add(block.line)
    for need in block.all_marks("needs"):
        meet(need, request, state)
    for name in block.all_marks("before"):
        state.names |= getattr(preparations, name)() or {}
    if block.kind == "output":
        missing = same_output(block.text, state.printed)
        assert missing is None, f"{block}: not printed: {missing!r}; printed:\n{state.printed}"
        return
    capsys.readouterr()
    if block.kind == "python":
        run_python(block, state.names)
    elif block.kind == "console":
        run_console(block)
    else:
        if block.language == "toml":
            tomllib.loads(block.text)
        if (name := block.mark("file")) is not None:
            path = state.folder / name
            assert path.resolve().is_relative_to(state.folder.resolve())
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.smaller, encoding="utf-8")
    state.printed = capsys.readouterr().out


def run_python(block: Block, names: dict) -> None:
    """Run a block so that a traceback shows the lines of the page."""
    source = "\n" * block.line + block.smaller
    name = f"docs/{block.page}:{block.line}"
    linecache.cache[name] = (len(source), None, source.splitlines(keepends=True), name)
    exec(compile(source, name, "exec"), names)


def run_console(block: Block) -> None:
    expected = {int(code) for code in (block.mark("exit") or "0").split(" or ")}
    for words, target in commands_of(block.smaller):
        if words[0] == "pivident":
            stdout = sys.stdout
            try:
                if target is not None:
                    sys.stdout = open(target, "w", encoding="utf-8")
                code = main(words[1:])
            finally:
                if target is not None:
                    sys.stdout.close()
                sys.stdout = stdout
        elif words[0] == "python" and words[1:2] and words[1].endswith(".py"):
            code = run_script(words[1:])
        else:
            pytest.fail(f"{block}: {words[0]!r} is not run here; mark the block with a skip")
        assert code in expected, f"{block}: {' '.join(words)} ended with {code}"


def run_script(words: list[str]) -> int:
    before, sys.argv = sys.argv, words
    try:
        runpy.run_path(words[0], run_name="__main__")
    except SystemExit as end:
        return int(end.code or 0)
    finally:
        sys.argv = before
    return 0


def meet(need: str, request, state: PageRun) -> None:
    """Skip where what a block needs is not here."""
    kind, _, name = need.partition(" ")
    if kind == "record":
        request.getfixturevalue("public_data")
        from pivident.data.recording.datasets import dataset_files

        try:
            dataset_files(name)
        except DatasetUnavailable:
            state.failed = None
            pytest.skip(f"the record {name} is not here")
    elif kind == "module":
        if importlib.util.find_spec(name) is None:
            state.failed = None
            pytest.skip(f"there is no Python package {name}")
    else:
        pytest.fail(f"a block needs {need!r}; known: record NAME, module NAME")


def check_other_test(block: Block, other: str) -> None:
    path = REPOSITORY / other
    assert path.is_file(), f"{block}: there is no {other}"
    assert Path(block.page).name in path.read_text("utf-8"), f"{other} does not name {block.page}"


def test_marks_are_read():
    text = (
        "<!-- needs: module numpy -->\n\ntext\n\n<!-- file: a/b.toml -->\n<!-- exit: 3 -->\n"
        "```toml\nx = 1\n```\n\n```\npivident robots   # all\n```\n\n```text\nshown\n```\n"
    )
    first, second, third = blocks_of(text, "page.md")
    assert first.kind == "file" and first.line == 7 and first.mark("exit") == "3"
    assert first.all_marks("needs") == ["module numpy"] == third.all_marks("needs")
    assert second.kind == "console" and third.kind == "shown"
    assert MARK.match("<!-- output -->")[1] == "output"
    with pytest.raises(AssertionError, match="no mark"):
        blocks_of("<!-- skp: no -->\n```python\n```\n", "page.md")
    with pytest.raises(AssertionError, match="mark of no block"):
        blocks_of("<!-- skip: for a reason -->\ntext\n", "page.md")


def test_commands_are_read():
    assert commands_of("pivident a 'b c'  # d\n\npivident e \\\n  f > g.c\n") == [
        (["pivident", "a", "b c"], None),
        (["pivident", "e", "f"], "g.c"),
    ]
    assert commands_of("$ pivident a\nprinted\n") == [(["pivident", "a"], None)]


def test_output_is_compared():
    printed = "a table\nm1r   94.84  0.45  kg\nfv1  197  13\nthe end\n"
    assert same_output("m1r 94.9 0.45 kg\n…\nthe end\n", printed) is None
    assert same_output("a ...\nfv1 … 13", printed) is None
    assert same_output("m1r 84.8 0.45 kg", printed) == "m1r 84.8 0.45 kg"
    assert same_output("the end\na table", printed) == "a table"
    assert same_word("(95.4", "(95.1") and not same_word("95.4%", "95.4")
    assert not same_word("1e-3", "-1e-3")


def test_no_block_runs_in_the_repository(runs):
    assert not runs("index.md").folder.is_relative_to(REPOSITORY)
    assert os.getcwd() != os.fspath(DOCS)
