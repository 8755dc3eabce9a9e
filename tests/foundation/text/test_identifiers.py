"""Names become identifiers that C and Python accept and that stay apart."""

import keyword

import pytest
from hypothesis import given, settings, strategies as st

from pivident.foundation.text.identifiers import (
    RESERVED,
    c_comment,
    identifier,
    identifiers,
    latex_name,
    latex_text,
    one_line,
)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("zz1r", "zz1r"),
        ("zzr[left elbow]", "zzr_left_elbow"),
        ("Stäubli TX40", "Staubli_TX40"),
        ("class", "class_"),
        ("double", "double_"),
        ("1st", "x1st"),
        ("", "x"),
        ("关节", "u5173_u8282"),
        ("a */ b", "a_b"),
    ],
)
def test_identifiers_read_like_their_names(name, expected):
    assert identifier(name) == expected


@settings(max_examples=100, deadline=None)
@given(st.lists(st.text(max_size=8), unique=True, max_size=5))
def test_identifiers_are_valid_and_different(names):
    texts = identifiers(names, ["x", "a"])
    assert len(set(texts)) == len(names)
    for text in texts:
        assert text.isidentifier() and text.isascii() and not keyword.iskeyword(text)
        assert text not in RESERVED and text not in ("x", "a")


def test_latex_names():
    assert latex_name("q2") == "q_{2}" and latex_name("ddq11") == r"\ddot{q}_{11}"
    assert latex_name("tau") == r"\tau" and latex_name("alpha3") == r"\alpha_{3}"
    assert latex_name("zzr[left_elbow]") == r"\mathit{zzr}_{\text{left\_elbow}}"
    assert latex_name("minus_uxx2") == r"\left(-\mathit{uxx}_{2}\right)"
    assert latex_text("50 % & {x}") == r"50 \% \& \{x\}"


@settings(max_examples=50, deadline=None)
@given(st.text(alphabet="?*/\\ \n\u2028a", max_size=12))
def test_a_comment_holds_its_text(text):
    first, line, last = c_comment([text])
    assert (first, last) == ("/*", " */") and line.startswith(" *")
    inside = line.removeprefix(" *")
    assert not any(mark in inside for mark in ("*/", "/*", "??", "\n", "\u2028"))
    assert one_line(inside).replace(" ", "") == one_line(text).replace(" ", "")
