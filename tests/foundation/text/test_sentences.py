"""Capital letters at the beginning of sentences and headings."""

import pytest

from pivident.foundation.text.sentences import capital


@pytest.mark.parametrize(
    ("text", "shown"),
    [("a body", "A body"), ("σ of q", "σ of q"), ("y", "y"), ("", ""), ("95 %", "95 %")],
)
def test_symbols_stay_small(text, shown):
    assert capital(text) == shown
