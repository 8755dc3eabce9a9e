"""Groups of parameters are compared by their factors, not by the last digit of a text."""

import pytest

from pivident.studies.payload.loaded_record import _is_same_group


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("xz3 - 0.00304601 m4", "xz3 - 0.00304602 m4", True),  # 0.0203 · 0.15005 is a tie
        ("xz3 - 0.00304601 m4", "xz3 - 0.0031 m4", False),
        ("xz3 - 0.00304601 m4", "xz3 - 0.00304601 m5", False),
        ("xz3", "xz3 - 0.00304601 m4", False),
        ("zz1 + 1e-05 m2", "zz1 + 1.00001e-05 m2", True),
    ],
)
def test_same_groups(one, other, same):
    assert _is_same_group(one, other) is same
