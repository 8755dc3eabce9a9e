"""Documentation promises only what is there: every code span that looks like a name is resolved.

Names are those of Python (with their keywords), commands and options, keys of files, methods, and
files of the repository; see ``code_spans.py``. What is none of pivident's is listed with its reason
(``listed_names.py``).
"""

from functools import cache

import pytest

from tests.docs.code_spans import REPOSITORY, Span, docstring_spans, kind_of, missing, spans_of
from tests.docs.listed_names import LISTED

PAGES = sorted(
    path.relative_to(REPOSITORY).as_posix()
    for place in ("README.md", "CHANGELOG.md", "docs/**/*.md")
    for path in REPOSITORY.glob(place)
)


@cache
def page_spans(page: str) -> tuple[Span, ...]:
    """The spans of a page; of the changelog those of what is not released."""
    text = (REPOSITORY / page).read_text("utf-8")
    if page == "CHANGELOG.md":
        text = "## ".join(text.split("\n## ")[:2])
    return tuple(spans_of(text, page))


@cache
def public_spans() -> tuple[Span, ...]:
    return tuple(docstring_spans())


def is_listed(span: Span) -> bool:
    return any(listed.has(span.text, span.page) for listed in LISTED)


def unresolved(spans: tuple[Span, ...]) -> list[str]:
    """What is neither there nor listed, with its place."""
    found = [(span, missing(span)) for span in spans]
    return [
        f"{s.place}: `{s.text}`: {lack}"
        for s, lack in found
        if lack is not None and not is_listed(s)
    ]


@pytest.mark.parametrize("page", PAGES)
def test_names_on_a_page_exist(page):
    assert unresolved(page_spans(page)) == []


def test_names_in_public_docstrings_exist():
    assert len(public_spans()) > 500
    assert unresolved(public_spans()) == []


def test_what_is_listed_is_needed():
    spans = [span for page in PAGES for span in page_spans(page)] + list(public_spans())
    lacking = [span for span in spans if missing(span) is not None]
    for listed in LISTED:
        assert len(listed.reason.split()) >= 2
        needed = {span.text for span in lacking if listed.has(span.text, span.page)}
        assert listed.names - needed == set(), listed.reason


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("pv.build_regression(problem)", "pv.build_regresion(problem)"),
        ("pivident.signals.irwsm(y, rate)", "pivident.signals.irwsmo(y, rate)"),
        ("Recording.part(seconds=…)", "Recording.part(second=…)"),
        ("result.torque(q, dq, ddq)", "result.torqe(q, dq, ddq)"),
        ("identify(…)", "identifies(…)"),
        ("Problem(robot, fixed={…: 1})", "Problem(robot, fix={…: 1})"),
        ("PrefilteredIV", "PrefilterdIV"),
        ("Prefilters", "CauseRows"),
        ("cross_validate", "cross_validation_of"),
        ("iv-full-rate", "iv-full-rat"),
        ("pc-piv", "pc-vip"),
        ("pivident identify FILE --folds 3", "pivident identify FILE --fold 3"),
        ("pivident datasets fetch emps", "pivident dataset fetch emps"),
        ("--folds", "--foldes"),
        ("[identify.piv]", "[identifies.piv]"),
        ('controller = "identify"', 'controler = "identify"'),
        ('signals = "algebraic"', 'signals = "algebraical"'),
        ('{term = "stribeck", speed = 0.05}', '{term = "stribek", speed = 0.05}'),
        ("examples/python/own_axes.py", "examples/python/no_axes.py"),
        ("verdict.json", "verdicts.json"),
        ("python -m tests.manual_page", "python -m tests.manual_pages"),
        ("make docs", "make dogs"),
        ("pip install '.[report]'", "pip install '.[reports]'"),
        ("numpy.linalg.LinAlgError", "numpy.linalg.LinearError"),
    ],
)
def test_what_is_not_there_is_found(right, wrong):
    assert missing(Span(right, "page:1", frozenset({"robot", "problem"}))) is None
    assert missing(Span(wrong, "page:1", frozenset({"robot", "problem"}))) is not None


def test_names_of_a_page_s_own_code_are_known_there():
    text = "Take `my_own_law`.\n\n```python\nmy_own_law = 1\n```\n\n`other_law` is not.\n"
    first, second = spans_of(text, "page.md")
    assert missing(first) is None and missing(second) == "no name 'other_law'"
    assert second.place == "page.md:7" and kind_of(second.text) == "word"
