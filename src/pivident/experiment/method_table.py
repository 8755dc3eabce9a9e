"""From the table ``[identify]`` of an experiment file to methods.

A ready method takes the shared options that concern it, and then those of its own table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, replace
from typing import Any

from pivident.errors import ExperimentError
from pivident.estimation.methods import (
    METHODS,
    Algebraic,
    Bandpass,
    InstrumentalVariables,
    LeastSquares,
    Method,
    OutputError,
    PrefilteredIV,
    RandomWalk,
    Regression,
    SignalRecipe,
    StateFilter,
)
from pivident.estimation.noise_options import Arma, AutoRegressive, Repetition
from pivident.experiment.method_keys import (
    IdentifyEntry,
    MethodEntry,
    RegressionEntry,
    SimulationEntry,
)
from pivident.robot.mdh_schema import Entry
from pivident.text.finding import Finding

#: Recipes by the names of their tables.
_RECIPES = {"bandpass": Bandpass, "algebraic": Algebraic, "random_walk": RandomWalk}

_ITERATION = {"tolerance", "max_iterations"}

#: The same for methods whose instruments may come from the record itself.
_INSTRUMENTS = {*_ITERATION, "instruments"}

#: Options that make the noise model an ARMA one.
_ARMA = {"ar_order", "ma_order", "largest_root"}

#: Options of the noise model that the paper does not have.
_NOT_PRINTED = {"on_unmasked", "motion_band", "repetition", "period"}


def method_of(name: str, entry: IdentifyEntry) -> Method:
    """One method with the file's options."""
    own, ready = entry.of(name), METHODS[name]
    if isinstance(ready, OutputError):
        assert isinstance(own, SimulationEntry)
        with concerning_method(name):
            return _simulation(ready, entry, own)
    if isinstance(own, RegressionEntry):
        assert isinstance(ready, (Regression, StateFilter))
        with concerning_method(name):
            return _regression(ready, entry, own)
    assert isinstance(own, MethodEntry)
    assert isinstance(ready, (LeastSquares, InstrumentalVariables, PrefilteredIV))
    with concerning_method(name):
        _check_keys(name, ready, own)
    if isinstance(ready, LeastSquares):
        return replace(ready, signals=_signals(entry, own, ready.signals))
    keys = _INSTRUMENTS if takes_any_instruments(ready) else _ITERATION
    options: dict[str, Any] = _given(entry, keys) | _given(own, keys)
    if isinstance(ready, InstrumentalVariables):
        return replace(ready, signals=_signals(entry, own, ready.signals), **options)
    as_printed = ready.as_printed if own.as_printed is None else own.as_printed
    noise = _noise(entry, own)
    if as_printed:
        return PrefilteredIV(noise=noise, as_printed=True, **options)
    options |= _given(own, {"prefilter", "covariance", "start"}) | {"regressor": ready.regressor}
    return PrefilteredIV(signals=_random_walk(entry, own), noise=noise, **options)


def median_finding(methods: Mapping[str, Method]) -> Finding | None:
    """That a median filter of the positions is not in all methods; None where it is, or is none."""
    recipes = {name: getattr(method, "signals", None) for name, method in methods.items()}
    passes = {name: s for name, s in recipes.items() if isinstance(s, Bandpass)}
    acts = {name: s.median for name, s in passes.items() if s.median > 1}
    others = [name for name in methods if name not in acts]
    if not acts or not others:
        return None
    text = (
        f"The median filter of the positions (bandpass.median = {max(acts.values())}) acts on "
        f"{', '.join(acts)} only: {', '.join(others)} smooth them in another way."
    )
    step = (
        "Positions that leave the motion and come back are left out of all methods without it; "
        "repair smaller outliers in the log."
    )
    return Finding("warning", "methods", "median", text, "", step)


@contextmanager
def concerning_method(name: str) -> Iterator[None]:
    """Errors inside name the table of a method."""
    try:
        yield
    except ExperimentError as error:
        raise error.within(f"identify.{name}") from error


def _simulation(ready: OutputError, entry: IdentifyEntry, own: SimulationEntry) -> OutputError:
    """A method that fits a simulation."""
    noise = _noise(entry, own)
    if isinstance(noise, (Arma, Repetition)):
        raise ExperimentError(
            "noise models of simulation errors are autoregressive; leave ar_order, ma_order and "
            "repetition out"
        ).about("noise")
    options: dict[str, Any] = _given(entry, {"max_iterations"}) | _given(own)
    for key in ("random_walk", "noise"):
        options.pop(key, None)
    if "bounds" in options:
        options["bounds"] = {name: tuple(pair) for name, pair in options["bounds"].items()}
    if "free" in options:
        options["free"] = tuple(options["free"])
    return replace(ready, signals=_random_walk(entry, own), noise=noise, **options)


def _regression(
    ready: Regression | StateFilter, entry: IdentifyEntry, own: RegressionEntry
) -> Regression | StateFilter:
    """A method without instruments, with its own options."""
    _check_signals(own, ready.signals)
    signals = _signals(entry, own, ready.signals)
    shared = _ITERATION & {f.name for f in fields(ready)}
    options: dict[str, Any] = _given(entry, shared) | _given(own)
    for key in ("signals", *_RECIPES):
        options.pop(key, None)
    return replace(ready, signals=signals, **{k: _tuples(v) for k, v in options.items()})


def _tuples(value: Any) -> Any:
    """Lists as tuples, so that a method can be compared and hashed."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def takes_any_instruments(method: Method) -> bool:
    """Whether a method's instruments may come from the record itself, without a loop."""
    if isinstance(method, PrefilteredIV):
        return method.regressor == "measured" and not method.as_printed
    return isinstance(method, InstrumentalVariables)


def _check_keys(
    name: str, ready: LeastSquares | InstrumentalVariables | PrefilteredIV, own: MethodEntry
) -> None:
    """Refuse keys that the method has no use for, and those that exclude each other."""
    if isinstance(ready, LeastSquares):
        known = {"signals", *_RECIPES}
    elif isinstance(ready, InstrumentalVariables):
        known = {"signals", _name_of(ready.signals), "algebraic", *_ITERATION}
    else:
        known = {"random_walk", "noise", "prefilter", "covariance", "start", *_ITERATION}
        known |= {"as_printed"} if ready.regressor == "measured" else set()
    known |= {"instruments"} if takes_any_instruments(ready) else set()
    foreign = sorted(own.model_fields_set - known)
    if foreign:
        raise ExperimentError(
            f"the method {name!r} has no {', '.join(foreign)}; its keys are "
            f"{', '.join(sorted(known))}"
        ).about(foreign[0])
    as_printed = own.as_printed is not False and (own.as_printed or name == "piv-as-printed")
    fixed = sorted({"random_walk", "prefilter", "covariance", "start"} & own.model_fields_set)
    fixed += [f"noise.{k}" for k in sorted(_NOT_PRINTED & own.noise.model_fields_set)]
    if as_printed and fixed:
        raise ExperimentError(
            f"as_printed follows the paper to the letter and fixes {', '.join(fixed)}; "
            "remove one of the two"
        ).about(*fixed[0].split("."))
    if not isinstance(ready, PrefilteredIV):
        _check_signals(own, ready.signals)
    if isinstance(ready, InstrumentalVariables) and own.signals not in (None, *known):
        raise ExperimentError(
            f"signals are {own.signals!r}; {name!r} takes {_name_of(ready.signals)!r} or "
            "'algebraic', and 'iv' and 'iv-full-rate' are the same with the other one"
        ).about("signals")


def _check_signals(own: MethodEntry | RegressionEntry, ready: SignalRecipe) -> None:
    """Refuse the table of signals that are not used."""
    used = own.signals or _name_of(ready)
    for unused in sorted(own.model_fields_set & (set(_RECIPES) - {used})):
        raise ExperimentError(
            f"{unused} is given, but the signals are {used!r}; set "
            f'signals = "{unused}" or remove the table'
        ).about(unused)


def _name_of(signals: SignalRecipe) -> str:
    """Name of a recipe in a file."""
    return next(name for name, kind in _RECIPES.items() if isinstance(signals, kind))


def _signals(
    entry: IdentifyEntry, own: MethodEntry | RegressionEntry, ready: SignalRecipe
) -> SignalRecipe:
    """The recipe that a file names, or that the method has."""
    name = own.signals or _name_of(ready)
    if name == "random_walk":
        return _random_walk(entry, own)
    if name == "bandpass":
        return replace(Bandpass(), **_decimated(entry.bandpass, own.bandpass))
    options = _decimated(entry.algebraic, own.algebraic)
    if isinstance(ready, RandomWalk) and not options.keys() & {"decimation", "bandwidth"}:
        options["decimation"] = 1
    return replace(Algebraic(), **{key: _tuples(value) for key, value in options.items()})


def _decimated(shared_entry: Entry, own_entry: Entry) -> dict[str, Any]:
    """Options of a recipe that decimates."""
    shared, special = _given(shared_entry), _given(own_entry)
    # A factor excludes a bandwidth; the method's own choice replaces the shared one.
    for key, other in (("decimation", "bandwidth"), ("bandwidth", "decimation")):
        if key in special:
            shared.pop(other, None)
    return shared | special


def _random_walk(
    entry: IdentifyEntry, own: MethodEntry | SimulationEntry | RegressionEntry
) -> RandomWalk:
    return replace(RandomWalk(), **_given(entry.random_walk) | _given(own.random_walk))


def _noise(entry: IdentifyEntry, own: MethodEntry | SimulationEntry) -> AutoRegressive | Arma:
    given = _given(own.noise) if own.noise.model_fields_set & _ARMA else {}
    given = given or _given(entry.noise) | _given(own.noise)
    if given.keys() & _ARMA:
        return Arma(**given)
    repeated = given.pop("repetition", False)
    return replace(Repetition() if repeated else AutoRegressive(), **given)


def _given(table: Entry, keys: set[str] | None = None) -> dict[str, Any]:
    """What the file says, without what it leaves to the defaults."""
    wanted = table.model_fields_set if keys is None else table.model_fields_set & keys
    return {key: getattr(table, key) for key in wanted}
