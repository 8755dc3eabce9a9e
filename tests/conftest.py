"""Folders of records and reference values, for tests marked ``record``; how tests are run."""

import contextlib
import copy
import gc
import os
from pathlib import Path

import pytest
from hypothesis import settings

# Before NumPy is imported: its threads wait in a loop for work that is too small to be shared,
# on the processors that the other tests need.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

# A busy machine, or the first call of a library, is no fault of what is tested. A test that fails
# has to fail again; `pytest --hypothesis-profile=searching` draws examples that nobody has tried.
settings.register_profile("patient", deadline=None, derandomize=True)
settings.register_profile("searching", deadline=None)
settings.load_profile("patient")

REPOSITORY = Path(__file__).resolve().parents[1]


def shared_folder(name: str) -> Path:
    """Beside the checkout, or where PIVIDENT_DATA (the records' folder, or its parent) points."""
    named = os.environ.get("PIVIDENT_DATA")
    roots = [Path(named), Path(named).parent] if named else [REPOSITORY.parent / "shared"]
    for root in roots:
        for folder in (root / name, root if root.name == name else root / name):
            if folder.is_dir():
                return folder
    pytest.skip(
        f"there is no {roots[0] / name}; set PIVIDENT_DATA to the folder that holds the records"
    )


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """No garbage is searched for while modules are imported, nor ever among what they leave."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


@pytest.hookimpl(trylast=True)
def pytest_configure(config):
    """While workers collect, a process beside them begins with the kernels that most tests need.

    Workers that need the same kernel wait for the first of them that compiles it, those included
    that are called where a module of tests is imported.
    """
    if os.name == "nt":
        return
    folder = config._tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        from tests.compiled_once import compiled_once

        locked = contextlib.ExitStack()
        locked.enter_context(compiled_once(folder.parent / "kernels"))
        config.add_cleanup(locked.close)
    elif getattr(config.option, "dist", "no") != "no":
        from tests.compiled_once import compiling_beside

        config.add_cleanup(compiling_beside(folder / "kernels"))


@pytest.fixture(scope="session", autouse=True)
def _nothing_is_compiled_beside():
    """What a command would compile beside itself is compiled already, or by a worker."""
    if "PYTEST_XDIST_WORKER" not in os.environ or os.name == "nt":
        yield
        return
    from pivident.app.cli import compile_ahead

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compile_ahead, "is_compiled", lambda kernel: True)
        yield


@pytest.fixture(scope="session", autouse=True)
def _figures_are_checked():
    """Pages write their figures as they are; in tests plotly first checks each attribute.

    Of figures that differ by their numbers alone it checks one, as it takes as long as the rest.
    """
    import numpy as np
    import plotly.graph_objects as go

    from pivident.judgement.report import builder

    written, seen = builder.to_json, set()

    def form(value):
        if isinstance(value, dict):
            return frozenset((key, form(own)) for key, own in value.items())
        if isinstance(value, (list, tuple)):
            return frozenset(map(form, value))
        if isinstance(value, np.ndarray):
            return (value.dtype.kind, value.ndim)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return (type(value), value >= 0, abs(value) <= 1)  # a share, a size, any number
        return value

    def checked(content, **options):
        if (own := form(content)) not in seen:
            go.Figure(copy.deepcopy(content))  # it takes types out of traces, and puts them last
            seen.add(own)
        return written(content, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(builder, "to_json", checked)
        yield


@pytest.fixture
def without_plotly(monkeypatch):
    """Pages without the five megabytes of script that draw their figures."""
    from pivident.foundation.document import plot

    monkeypatch.setattr(plot, "library_text", lambda: "")
    plot.drawing_library.cache_clear()
    yield
    plot.drawing_library.cache_clear()


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Public records: ``$PIVIDENT_DATA``, its subfolder ``data``, or ``../shared/data``."""
    return shared_folder("data")


@pytest.fixture(scope="session")
def reference_dir() -> Path:
    """Reference values: ``reference`` beside the records, or ``../shared/reference``."""
    return shared_folder("reference")


@pytest.fixture(scope="module")
def public_data(data_dir):
    """The public records, found by the program itself."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIVIDENT_DATA", str(data_dir))
        yield data_dir
