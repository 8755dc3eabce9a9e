"""What holds for the templates of every page: tables that can be followed by ear."""

import re
from pathlib import Path

import pytest

import pivident

ROOT = Path(pivident.__file__).parent
TEMPLATES = {str(path.relative_to(ROOT)): path for path in ROOT.glob("**/templates/*.html")}


@pytest.mark.parametrize("name", sorted(TEMPLATES))
def test_headings_of_tables_say_what_they_head(name):
    text = TEMPLATES[name].read_text(encoding="utf-8")
    heads = re.findall(r"<th(?=[\s>])[^>]*", text)
    assert [head for head in heads if "scope=" not in head] == []
    assert not re.search(r"<th[^>]*></th>", text)
    for head in re.findall(r"<thead>.*?</thead>", text, re.DOTALL):
        assert 'scope="row' not in head


@pytest.mark.parametrize("name", sorted(TEMPLATES))
def test_wide_tables_scroll_from_the_keyboard(name):
    text = TEMPLATES[name].read_text(encoding="utf-8")
    for start in re.findall(r'<div class="scroll"[^>]*>', text):
        assert 'tabindex="0"' in start and 'role="region"' in start and "aria-label=" in start
