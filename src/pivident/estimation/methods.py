"""All methods by name: those of pivident, and those of other distributions."""

from __future__ import annotations

from pivident.estimation.method import Estimator, Method
from pivident.foundation.errors import IdentificationError
from pivident.foundation.registry import Registry
from pivident.robot.naming import nearest

#: Names that the command line and experiment files use.
METHODS: Registry[Method] = Registry(
    "pivident.methods",
    Method,
    {
        "ols": "pivident.estimation.least_squares:OLS",
        "ls": "pivident.estimation.least_squares:LS",
        "tls": "pivident.estimation.literature.total_least_squares:TotalLeastSquares",
        "irls": "pivident.estimation.literature.robust_regression:RobustRegression",
        "ridge": "pivident.estimation.literature.penalised_regression:Ridge",
        "map": "pivident.estimation.literature.penalised_regression:PriorRegression",
        "ml-ls": "pivident.estimation.literature.correlated_joints:CorrelatedJoints",
        "set-membership": "pivident.estimation.literature.set_membership:SetMembership",
        "adaline": "pivident.estimation.literature.neural_networks:Adaline",
        "hopfield": "pivident.estimation.literature.neural_networks:Hopfield",
        "frequency": "pivident.estimation.literature.frequency_domain:FrequencyDomain",
        "ekf": "pivident.estimation.literature.filters.kalman_filters:ExtendedKalman",
        "ukf": "pivident.estimation.literature.filters.kalman_filters:UnscentedKalman",
        "cdkf": ("pivident.estimation.literature.filters.kalman_filters:CentralDifferenceKalman"),
        "particle": "pivident.estimation.literature.filters.particle_filter:Particles",
        "iv": "pivident.estimation.instrumental_variables:IV",
        "iv-full-rate": "pivident.estimation.instrumental_variables:IV_FULL_RATE",
        "piv": "pivident.estimation.prefiltered_iv:PIV",
        "didim": "pivident.estimation.didim:DIDIM",
        "piv-as-printed": "pivident.estimation.prefiltered_iv:PIV_AS_PRINTED",
        "cloe": "pivident.estimation.output_error.output_error:CLOE",
        "clie": "pivident.estimation.output_error.output_error:CLIE",
        "ml": "pivident.estimation.output_error.output_error:ML",
        "oloe": "pivident.estimation.output_error.output_error:OLOE",
    },
)

#: Methods that are taken where a log has no torque and nobody names others.
WITHOUT_TORQUE: tuple[str, ...] = ("cloe",)


def method_named(method: Method | Estimator | str) -> Method:
    """A method, given itself, one of the names in ``METHODS``, or a function of Φ and τ.

    Raises:
        IdentificationError: there is no method of this name; names the nearest.
        BrokenExtension: another distribution declares it, and it cannot be used.
    """
    if callable(method):
        from pivident.estimation.own_estimate import OwnMethod

        return OwnMethod(estimator=method)
    if not isinstance(method, str):
        return method
    if method not in METHODS:
        raise IdentificationError(
            f"unknown method {method!r}",
            advice=f"identify with {free!r} and give the result to make_consistent"
            if (free := method.removeprefix("pc-")) in METHODS
            else nearest(method, METHODS),
        )
    return METHODS[method]


def name_of(method: Method) -> str:
    """The first name whose methods are of a method's class; empty for a class of no name."""
    kind = type(method)
    return next((n for n in METHODS.names_in(kind.__module__) if type(METHODS[n]) is kind), "")
