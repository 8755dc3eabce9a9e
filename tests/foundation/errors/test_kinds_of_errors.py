"""Every error of pivident has its base and a builtin cousin, and reaches another process whole.

The classes are found by importing all modules, so that a new one is tested without being named.
"""

import inspect
import multiprocessing
import pickle
import pkgutil
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from importlib import import_module
from typing import get_args, get_origin, get_type_hints

import numpy as np
import pytest

import pivident
from pivident.foundation.errors import (
    Advised,
    IdentificationError,
    PividentError,
    PividentWarning,
    UnknownName,
)
from pivident.foundation.errors.recordings import Stretches

#: The bases, which have no cousin of their own.
BASES = {Advised, PividentError}

#: A value for each type of argument, and for arguments whose type says too little.
VALUES = {
    int: 2, float: 1.5, str: "elbow", bool: True, complex: 1 + 2j, object: "folder",
    np.ndarray: np.eye(2), Stretches: Stretches(((0.0, 1.0),), 2.0, 1.0, 0.0, resample=True),
}  # fmt: skip
NAMED = {"kind": "jitter"}


def value(wanted):
    """A value of a type as annotations have it."""
    if wanted in VALUES:
        return VALUES[wanted]
    parts = [part for part in get_args(wanted) if part is not type(None)]
    if get_origin(wanted) is tuple:
        return tuple(value(part) for part in parts if part is not ...)
    if get_origin(wanted) in (Sequence, Iterable):
        return [value(parts[0])] * 2
    return value(parts[0])


@cache
def kinds():
    """All exceptions that modules of pivident define, but for private ones, which never leave."""
    for module in pkgutil.walk_packages(pivident.__path__, "pivident."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
    found, waiting = set(), [Exception]
    while waiting:
        for kind in waiting.pop().__subclasses__():
            if kind not in found:
                found.add(kind)
                waiting.append(kind)
    own = [k for k in found if k.__module__.startswith("pivident.") and k.__name__[0] != "_"]
    return sorted(own, key=lambda kind: (kind.__module__, kind.__name__))


def errors():
    """One error of each kind, with all that its constructor takes, and a note."""
    made = []
    for kind in kinds():
        if issubclass(kind, PividentError):
            types = get_type_hints(kind.__init__, {**globals(), "np": np})
            given = inspect.signature(kind).parameters
            error = kind(**{name: NAMED.get(name, value(types[name])) for name in given})
            error.add_note("of the second log")
            made.append(error)
    return made


def fail(number):
    """What a worker does whose work ends with an error."""
    raise errors()[number]


def assert_same(error, other):
    assert type(other) is type(error)
    assert (str(other), other.args) == (str(error), error.args)
    assert vars(other).keys() == vars(error).keys()
    for name, evidence in vars(error).items():
        np.testing.assert_equal(getattr(other, name), evidence)


def test_there_are_kinds_to_test():
    assert len(kinds()) > 55
    assert {UnknownName, IdentificationError, PividentWarning} < set(kinds())


def test_every_kind_has_the_base_and_a_cousin_of_python():
    for kind in set(kinds()) - BASES:
        if issubclass(kind, Warning):
            assert issubclass(kind, PividentWarning) and issubclass(kind, UserWarning)
            continue
        assert issubclass(kind, PividentError), kind
        cousins = [c for c in kind.__mro__ if c.__module__ == "builtins"]
        assert set(cousins) - {Exception, BaseException, object}, kind


def test_every_kind_has_its_evidence_behind_pickle():
    for error in errors():
        for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
            assert_same(error, pickle.loads(pickle.dumps(error, protocol)))


def test_pools_survive_every_kind():
    """An error whose arguments do not make it again breaks a pool, or leaves it waiting."""
    whole, context = errors(), multiprocessing.get_context("fork")
    with ProcessPoolExecutor(1, context) as executor:
        futures = [executor.submit(fail, k) for k in range(len(whole))]
        for error, future in zip(whole, futures, strict=True):
            assert_same(error, future.exception(timeout=60))
        assert executor.submit(abs, -1).result(timeout=60) == 1
    with context.Pool(1) as pool:
        results = [pool.apply_async(fail, (k,)) for k in range(len(whole))]
        for error, result in zip(whole, results, strict=True):
            with pytest.raises(type(error)) as caught:
                result.get(timeout=60)
            assert_same(error, caught.value)


def test_evidence_that_cannot_travel_stays_behind():
    error = IdentificationError("it cannot be simulated", advice="check the gains")
    error.problem, error.sample = (lambda: None), 3
    other = pickle.loads(pickle.dumps(error))
    assert (str(other), other.advice, other.sample) == (str(error), "check the gains", 3)
    assert not hasattr(other, "problem")


def test_an_unknown_name_is_not_quoted_as_a_key_is():
    error = UnknownName("no parameter 'zz9'", advice="did you mean 'zz1'?")
    assert str(error) == "no parameter 'zz9'; did you mean 'zz1'?"
    with pytest.raises(KeyError):
        raise error
