"""The fingerprint of a result covers the code that affects its numbers."""

from pathlib import Path

import pivident
from pivident.studies.many.batch.results_folder import NUMERICAL


def test_every_numerical_package_has_code():
    package = Path(pivident.__file__).parent
    assert [name for name in NUMERICAL if not any((package / name).rglob("*.py"))] == []


def test_a_change_of_the_numerics_changes_it(tmp_path, monkeypatch):
    from pivident.studies.many.batch import results_folder as module

    place = tmp_path / "studies" / "many" / "batch" / "fingerprint.py"
    code = tmp_path / "estimation" / "identify.py"
    for file in (place, code):
        file.parent.mkdir(parents=True)
        file.write_text("x = 1\n")
    monkeypatch.setattr(module, "__file__", str(place))
    before = module.fingerprint.__wrapped__()
    code.write_text("x = 2\n")
    assert module.fingerprint.__wrapped__() != before
