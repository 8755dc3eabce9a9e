"""Code spans of the documentation: what kind of name each looks like, and what is not there."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import inspect
import re
import shlex
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from tests.docs import known_names as known
from tests.docs.page_blocks import blocks_of

REPOSITORY = Path(__file__).resolve().parents[2]

#: Other packages by the names that pages import them under; looked up where they are installed.
PACKAGES = {"np": "numpy", "pd": "pandas", "sm": "statsmodels.api", "pv": "pivident"}
OTHERS = (
    "numpy scipy pandas statsmodels linearmodels sklearn pinocchio mujoco numba matplotlib "
    "concurrent csv ctypes dataclasses logging msvcrt pivident tomlkit warnings"
).split()
PACKAGES |= {name: name for name in OTHERS}
#: Folders of the repository that paths begin with.
FOLDERS = ("examples", "benchmarks", "docs", "tests", "src", "tools")
ENDINGS = (
    "csv tsv txt json html md toml urdf xml mjcf sdf mat npz npy bag db3 mcap parquet py c h tex "
    "cpp yaml png msg mod src script cff"
).split()
SPAN = re.compile(r"(?<!`)(`+)(?!`)((?:.|\n(?!\s*\n))+?)(?<!`)\1(?!`)")
COMMAND = re.compile(r"(?:pivident|python|pip|make)(?: |$)|--?[A-Za-z]")
FILE = re.compile(rf"[\w{{}}*./~-]*\.(?:{'|'.join(ENDINGS)})|(?:{'|'.join(FOLDERS)})/\S+(?: .*)?")
WORD = re.compile(r"[A-Za-z_]\w*(?:-\w+)*-?")
TABLE = re.compile(r"\[{1,2}([A-Za-z_][\w.-]*)\]{1,2}(?:\s+(.*))?")
KEY = re.compile(r"[\w.]+ = |\{[\w ]+ = |\[[\[{\"]")
PYTHON = re.compile(r"[A-Za-z_][\w.]*[.(=\[]\S*|\"[\w.-]+\"|.*(?:\bpv\.|\bpivident\.|\w\(.*\)).*")
CLASS = re.compile(r"(?:[A-Z][a-z0-9]+){2,}")
#: Written in place of something that the reader chooses.
PLACEHOLDER = re.compile(r"[A-Z]{3,}")


@dataclass(frozen=True)
class Span:
    """A code span: its text, where it stands, and the words of the code around it."""

    text: str
    place: str
    around: frozenset[str]

    @property
    def page(self) -> str:
        return self.place.rpartition(":")[0]


def spans_of(text: str, page: str) -> Iterator[Span]:
    """The code spans of a page; words of its blocks, which are run, are known there."""
    blocks = blocks_of(text, page)
    around = frozenset(word for block in blocks for word in words_in(block.text))
    inside = {n for b in blocks for n in range(b.line, b.line + b.text.count("\n") + 2)}
    lines = ["" if n in inside else line for n, line in enumerate(text.split("\n"), start=1)]
    prose = re.sub(
        r"<!--.*?-->", lambda m: "\n" * m[0].count("\n"), "\n".join(lines), flags=re.DOTALL
    )
    for match in SPAN.finditer(prose):
        line = prose.count("\n", 0, match.start()) + 1
        yield Span(" ".join(match[2].split()), f"{page}:{line}", around)


def docstring_spans() -> Iterator[Span]:
    """The code spans of public docstrings; their arguments and attributes are known in each."""
    for name, value in known.public_objects().items():
        owners = [(name, value)]
        if isinstance(value, type):
            owners += [
                (f"{name}.{key}", item) for key, item in vars(value).items() if key[0] != "_"
            ]
        for place, item in owners:
            function = getattr(item, "__func__", None) or getattr(item, "fget", None) or item
            if not isinstance(getattr(function, "__doc__", None), str) or not known.own(function):
                continue
            around = words_in(
                "\n".join(re.findall(r"^\s*(?:>>>|\.\.\.) (.*)", function.__doc__, re.MULTILINE))
            )
            around |= known.arguments_of(function)
            if isinstance(value, type):
                around |= known.attributes_of(value)
            for found in spans_of(inspect.cleandoc(function.__doc__), place):
                yield Span(found.text, found.place, found.around | around)


def words_in(code: str) -> set[str]:
    """Words of code, with and without their dots, dashes and folders."""
    patterns = (r"\w+", r"[\w-]+", r"[\w.]+", r"[\w.-]+", r"[\w./-]+")
    return {word for pattern in patterns for word in re.findall(pattern, code)}


def kind_of(text: str) -> str:
    """What a span looks like; a text is no name: a value, a formula, another program's output."""
    if COMMAND.match(text):
        return "command"
    if FILE.fullmatch(text):
        return "file"
    if TABLE.fullmatch(text) or KEY.match(text):
        return "key"
    if WORD.fullmatch(text):
        return "word"
    return "python" if PYTHON.fullmatch(text) else "text"


def missing(span: Span) -> str | None:
    """What of a span is not there, or None."""
    return CHECKS[kind_of(span.text)](span.text, span.around)


# --- commands and files


def command(text: str, around: frozenset[str]) -> str | None:
    """A command with its options, or options of any command or script."""
    head, *rest = shlex.split(text.replace("…", ""))
    if head == "make":
        targets = re.findall(
            r"^([\w-]+):", (REPOSITORY / "Makefile").read_text("utf-8"), re.MULTILINE
        )
        return next((f"no target {target!r}" for target in rest if target not in targets), None)
    if head == "pip":
        named = {extra for group in re.findall(r"\[([\w,]+)\]", text) for extra in group.split(",")}
        return f"no extra {named - extras()}" if named - extras() else None
    if head == "python":
        module = rest[1].replace(".", "/") if rest[0] == "-m" else ""
        places = (REPOSITORY / module, REPOSITORY / "src" / module)
        if module:
            there = any(p.is_dir() or p.with_suffix(".py").is_file() for p in places)
            return None if there else f"no module {rest[1]!r}"
        return None if rest[0] == "-c" else file(rest[0], around)
    called: tuple[str, ...] = ()
    if head == "pivident":
        for one in rest:
            called += (one,) if (*called, one) in known.options() else ()
        if not called and rest and not rest[0].startswith("-"):
            return f"no command {rest[0]!r}"
        has = known.options()[called]
    else:
        has, rest = set().union(*known.options().values()) | known.script_options(), [head, *rest]
    given = [re.split("[= ]", o)[0] for o in rest if re.match(r"--?[A-Za-z]", o)]
    return next((f"no option {o}" for o in given if o not in has), None)


@cache
def extras() -> set[str]:
    """Extras that can be installed."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]
    return set(project["optional-dependencies"])


def file(text: str, around: frozenset[str]) -> str | None:
    """A file of the repository, one that pivident writes, or one that the page speaks of."""
    path = text.split()[0]
    name = Path(path).name
    if path.split("/")[0] in FOLDERS:
        if path in (REPOSITORY / ".gitignore").read_text("utf-8").split():
            return f"{path} is no part of the repository"
        return None if any(REPOSITORY.glob(path)) else f"no file {path}"
    if {name, path} & around or re.fullmatch(r"\W*\.\w+", name) or PLACEHOLDER.search(name):
        return None
    return None if name in files() or written(name) else f"no file {path}"


@cache
def files() -> set[str]:
    """Names of the files of the repository."""
    folders = [REPOSITORY, *(REPOSITORY / folder for folder in FOLDERS)]
    return {
        path.name
        for folder in folders
        for path in folder.glob("**/*" if folder != REPOSITORY else "*")
    }


@cache
def written(name: str) -> bool:
    """Whether a string of the sources ends with this name, or two are its stem and ending."""
    stem, dot, ending = name.rpartition(".")
    strings = known.strings()
    return any(s.endswith(name) for s in strings) or {stem, dot + ending} <= strings


# --- keys of files


def key(text: str, around: frozenset[str]) -> str | None:
    """Keys of a table, and the words that are their values."""
    if header := TABLE.fullmatch(text):
        names = [*header[1].split("."), *re.findall(r"\w+", (header[2] or "").partition("=")[0])]
    else:
        whole = re.sub(r",? ?(?:…|\.\.\.)(?=[\]}])", "", text)
        whole = re.sub(r"(?<== )(?:…|\.\.\.)$", "0", whole)
        try:
            names = words_of(
                tomllib.loads(whole if re.match(r"[\w.]+ =", whole) else f"by = {whole}")
            )
        except tomllib.TOMLDecodeError:
            names = re.findall(r"([A-Za-z_][\w.]*) = ", text)
    return next((f"no key {name!r}" for name in names if not is_word(name, around)), None)


def words_of(value: Any) -> list[str]:
    """Keys of a value of TOML and of those inside it, and texts that are words."""
    if isinstance(value, dict):
        return [*value, *(word for inner in value.values() for word in words_of(inner))]
    if isinstance(value, list):
        return [word for inner in value for word in words_of(inner)]
    return [value] if isinstance(value, str) and WORD.fullmatch(value) else []


# --- words and Python


def is_word(text: str, around: frozenset[str] = frozenset()) -> bool:
    """Whether a word is a name of pivident, of Python, of a package, or of its page's code."""
    return (
        text in around
        or text in known.names()
        or (text in known.strings() and not CLASS.fullmatch(text))
        or known.parameter().fullmatch(text) is not None
        or PLACEHOLDER.match(text) is not None
        or text in PACKAGES
        or text in FOLDERS
    )


def word(text: str, around: frozenset[str]) -> str | None:
    return None if is_word(text, around) else f"no name {text!r}"


def python(text: str, around: frozenset[str]) -> str | None:
    """Names, attributes and keywords of an expression or statement of Python."""
    source = re.sub(r"=(?=[,)])", "=...", text.replace("…", "...")).removesuffix("=")
    if source in known.strings() or source in around:
        return None
    try:
        tree = ast.parse(source)
    except SyntaxError:  # a formula, or a name with words around it
        return text_names(source, around)
    stored = {
        n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }
    checks: dict[type, Callable[[Any], str | None]] = {
        ast.Call: lambda node: called(node, around),
        ast.Attribute: lambda node: attribute(node, around),
        ast.Name: lambda node: word(node.id, around | stored),
        ast.Constant: lambda node: constant(node.value, around),
    }
    found = (checks[type(node)](node) for node in ast.walk(tree) if type(node) in checks)
    return next((text for text in found if text is not None), None)


def text_names(content: str, around: frozenset[str]) -> str | None:
    """Names with an underscore in a text, but for topics of a bag."""
    names = [] if content.startswith("/") else named_in(content)
    return next((f"no name {name!r}" for name in names if not is_word(name, around)), None)


def named_in(text: str) -> list[str]:
    """Words of a text that look like names: with an underscore, or before a parenthesis."""
    return [
        w.rstrip("(") for w in re.findall(r"[A-Za-z_]\w*\(?", text) if w.endswith("(") or "_" in w
    ]


def constant(value: Any, around: frozenset[str]) -> str | None:
    return word(value, around) if isinstance(value, str) and WORD.fullmatch(value) else None


def dotted(node: ast.expr) -> str:
    """The dotted name of an expression, or empty."""
    if isinstance(node, ast.Name):
        return node.id
    head = dotted(node.value) if isinstance(node, ast.Attribute) else ""
    return f"{head}.{node.attr}" if head else ""


def attribute(node: ast.Attribute, around: frozenset[str]) -> str | None:
    """An attribute of a module or class, where the root is one; else of any public class."""
    name = dotted(node)
    head = name.partition(".")[0]
    if name in around or PLACEHOLDER.match(node.attr):
        return None
    if head in PACKAGES:
        package = PACKAGES[head] + name[len(head) :]
        installed = importlib.util.find_spec(package.partition(".")[0]) is not None
        return f"no {name}" if installed and not there(package) else None
    if there(f"pivident.{name}"):
        return None
    kind = known.public_objects().get(head)
    has = known.attributes_of(kind) if isinstance(kind, type) else known.attributes()
    return None if node.attr in has else f"no attribute {name or node.attr}"


@cache
def there(name: str) -> bool:
    """Whether a dotted name can be imported, attributes of instances included."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            value: Any = importlib.import_module(".".join(parts[:count]))
        except ImportError:
            continue
        for part in parts[count:]:
            if not hasattr(value, part):
                return isinstance(value, type) and part in known.attributes_of(value)
            value = getattr(value, part)
        return True
    return False


def called(node: ast.Call, around: frozenset[str]) -> str | None:
    """A function or method that takes the keywords it is given."""
    name = dotted(node.func)
    last = node.func.attr if isinstance(node.func, ast.Attribute) else name
    if (
        last in around
        or last in known.BUILTINS
        or name.partition(".")[0] in {*PACKAGES} - {"pv", "pivident"}
    ):
        return None
    if name.startswith("pivident."):
        return None if there(name) else f"no {name}"
    takes = [known.arguments_of(item) for item in known.callables(last)]
    given = {keyword.arg for keyword in node.keywords if keyword.arg is not None}
    if not takes:
        return f"no function {name or last}"
    if any(given <= taken or "**" in taken for taken in takes):
        return None
    return f"{last} takes no {sorted(given - set().union(*takes)) or sorted(given)}"


CHECKS = {
    "command": command,
    "file": file,
    "key": key,
    "word": word,
    "python": python,
    "text": text_names,
}
