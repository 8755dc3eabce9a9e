"""Compiled functions and their cache."""

from pathlib import Path
from types import SimpleNamespace

from pivident.foundation.compiled import is_compiled


def test_a_kernel_is_compiled_where_its_cache_has_it(tmp_path):
    kernel = SimpleNamespace(
        stats=SimpleNamespace(cache_path=str(tmp_path)), py_func=SimpleNamespace(__name__="run")
    )
    assert not is_compiled(kernel)
    Path(tmp_path, "loop.runs-3.py311.nbi").touch()
    assert not is_compiled(kernel)
    Path(tmp_path, "loop.run-3.py311.nbi").touch()
    assert is_compiled(kernel)
    assert is_compiled(len)  # nothing is compiled at all
