"""Stored results with other values at any depth: they are read, or refused by the file's name."""

import random

import pytest
from fuzzing.json_inputs import inside_json

from pivident.foundation.errors import PividentError
from tests.foundation.test_codec import FILES, read


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_spoilt_files_are_read_or_refused(file, tmp_path):
    rng, data = random.Random(1), file.read_bytes()
    path, refused = tmp_path / file.name, 0
    for _ in range(150):
        path.write_bytes(inside_json(data, rng))
        try:
            read(path)
        except PividentError as error:
            refused += 1
            assert str(path) in str(error) and "\n" not in str(error)
    assert refused > 50
