"""Methods as somebody chooses them: in groups, each in a few words."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MethodGroup:
    """Methods that belong together.

    Attributes:
        title: heading.
        methods: what each is, by its name.
        folded: whether the page shows them only when asked.
    """

    title: str
    methods: dict[str, str]
    folded: bool = True


#: All methods; docs/reference/methods.md says more.
GROUPS = (
    MethodGroup(
        "",
        {
            "ls": "least squares: fast, and biased by the feedback loop",
            "iv-full-rate": "instrumental variables: no bias, intervals too wide",
            "piv": "prefiltered instrumental variables: no bias, correct intervals",
            "iv": "instrumental variables on filtered, decimated signals",
            "pc-piv": "the physically consistent parameters nearest to those of piv",
        },
        folded=False,
    ),
    MethodGroup(
        "Methods that fit a simulation",
        {
            "ml": "positions and torques by their noise; needs law and reference",
            "cloe": "positions of the simulated closed loop",
            "clie": "torques of the simulated closed loop",
            "oloe": "positions of the robot driven by the recorded torques",
            "didim": "for coarse encoders with a known law and reference",
        },
    ),
    MethodGroup(
        "Regressions",
        {
            "ols": "least squares without weights",
            "wls": "the same as ls",
            "tls": "total least squares",
            "irls": "robust against spikes and lost samples",
            "ridge": "shrinks what the motion hardly determines",
            "map": "with a normal prior from the description",
            "ml-ls": "with the covariance between the joints",
            "set-membership": "guaranteed intervals for bounded errors",
            "adaline": "step by step, for comparison",
            "hopfield": "step by step, for comparison",
            "frequency": "on the lines of a periodic motion",
            "piv-as-printed": "piv exactly as the paper prints it",
        },
    ),
    MethodGroup(
        "Filters",
        {
            "ekf": "extended Kalman filter",
            "ukf": "unscented Kalman filter",
            "cdkf": "central difference Kalman filter",
            "particle": "particle filter, slow",
        },
    ),
)

#: What is chosen where the experiment file says nothing.
DEFAULT = ("ls", "iv-full-rate", "piv")
