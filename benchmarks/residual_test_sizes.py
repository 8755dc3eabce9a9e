"""Size and power of the tests on residuals: rejections at 5 % over short simulated records.

    python benchmarks/residual_test_sizes.py [--runs 1000] [--piv-runs 500]

Under its null each test should reject 5 % of the records ([3, 7] % is asked over 1,000). The first
table has made-up residuals, with and without gaps; the second has the residuals that IDIM-PIV
leaves on a planar arm whose torque the smoothed motion explains exactly, but for AR noise. There
the parameters, the filter and its order are all estimated.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

import pivident as pv
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.judgement.validation.residuals.autocorrelation import (
    JointResidual,
    durbin_watson,
    ljung_box,
)
from pivident.judgement.validation.residuals.cross_correlation import variance_test
from pivident.judgement.validation.residuals.residual_tests import normality, residual_tests
from pivident.loop.motion.motion import torque_of
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot
from pivident.signals.noise_models import fit_ar, lagged_sums, whiten

SAMPLES = 1500
COLOUR = np.poly([0.9 * np.exp(0.5j), 0.9 * np.exp(-0.5j), 0.6, -0.5]).real
DRIVER = np.abs(np.sin(np.linspace(0.0, 12.0, SAMPLES)))

Maker = Callable[[np.random.Generator], JointResidual]


def gaps(x: np.ndarray) -> np.ndarray:
    """A quarter of the samples do not vote."""
    x = x.copy()
    x[(np.arange(x.size) // 50) % 4 == 3] = np.nan
    return x


def white(rng: np.random.Generator, *, masked: bool = False) -> JointResidual:
    x = rng.standard_normal(SAMPLES)
    return JointResidual("joint", (gaps(x) if masked else x,))


def coloured(rng: np.random.Generator) -> JointResidual:
    x = rng.standard_normal(SAMPLES)
    return JointResidual("joint", (x[1:] + 0.15 * x[:-1],))


def whitened(rng: np.random.Generator, *, order: int | None = None, n: int = 2000) -> JointResidual:
    """AR(4) noise through the whitener that was fitted to it, order given or by AIC."""
    v = lfilter([1.0], COLOUR, rng.standard_normal(n + 300))[300:]
    model = fit_ar(v, 60, order=order)
    x = whiten(model, v - model.mean)
    x[: model.order] = np.nan
    penalty = 2.0 if order is None else None
    return JointResidual("joint", (x,), model.order, prefiltered=True, penalty=penalty)


def too_low(rng: np.random.Generator) -> JointResidual:
    return whitened(rng, order=3)


def changing_variance(rng: np.random.Generator) -> JointResidual:
    return JointResidual("joint", (rng.standard_normal(SAMPLES) * (0.3 + DRIVER),))


def heavy_tails(rng: np.random.Generator) -> JointResidual:
    return JointResidual("joint", (rng.standard_t(5, SAMPLES),))


def driven(residual: JointResidual, products: bool) -> float:
    x = residual.pieces[0]
    voted = np.isfinite(x)
    drivers = np.column_stack([DRIVER, np.roll(DRIVER, 100)])[voted]
    return variance_test(x[voted], drivers, ("speed", "torque"), products=products).p_value


def normal_p(residual: JointResidual) -> float:
    return normality(residual.values, lagged_sums(residual.pieces, 100)).p_value


def masked(rng: np.random.Generator) -> JointResidual:
    return white(rng, masked=True)


#: Name, records under the null, records that violate it, p-value.
CASES: list[tuple[str, list[Maker], Maker, Callable[[JointResidual], float]]] = [
    ("Ljung-Box, no model", [white, masked], coloured, lambda r: ljung_box(r).p_value),
    (
        "Ljung-Box, robust",
        [white, masked, changing_variance],
        coloured,
        lambda r: ljung_box(r).robust_p_value,
    ),
    (
        "Ljung-Box, AR(4), given and by AIC",
        [lambda g: whitened(g, order=4), whitened],
        too_low,
        lambda r: ljung_box(r).p_value,
    ),
    ("Durbin-Watson", [white, masked], coloured, lambda r: durbin_watson(r).p_value),
    ("D'Agostino-Pearson", [white, masked], heavy_tails, normal_p),
    ("Breusch-Pagan", [white, masked], changing_variance, lambda r: driven(r, False)),
    ("White", [white, masked], changing_variance, lambda r: driven(r, True)),
]


def rejections(make: Maker, p_value: Callable[[JointResidual], float], runs: int) -> float:
    """Share of the records on which a test rejects at 5 % [%]."""
    values = [p_value(make(np.random.default_rng((7, k)))) for k in range(runs)]
    return 100.0 * float(np.mean(np.array(values) < 0.05))


class PlanarArm:
    """Records of a planar arm whose torque is the smoothed motion's, but for the noise.

    Args:
        samples: length at 1 kHz.
    """

    #: no alignment: averaged over two periods, the torque's noise is a moving average with a zero
    #: at the Nyquist frequency, which is no AR noise of finite order
    signals = RandomWalk(align=False)

    def __init__(self, samples: int = 2000) -> None:
        self.robot = load_robot("planar_2r")
        base = base_parameters(self.robot)
        self.controller = PD(np.array([6000.0, 2500.0]), np.array([180.0, 60.0]))
        theta = base.values(nominal_values(self.robot, base.standard))
        self.truth = dict(zip(base.names, theta.tolist(), strict=True))
        postures = np.random.default_rng(2).uniform(-1.5, 1.5, (30, 2))
        speeds = 0.8 * self.robot.rated_speeds
        self.q_ref, _, _ = point_to_point(postures, speeds, 1000.0, samples)
        signals = LoopSignals(
            rate=1000.0,
            q_ref=self.q_ref,
            dq_ref=None,
            inputs=None,
            noise=np.zeros_like(self.q_ref),
            drive_gain=np.ones(2),
            limit=np.full(2, np.inf),
            bound=np.full(2, 0.5),
            speed_bound=np.full(2, 50.0),
        )
        model = make_model(self.robot, base.parameters, theta)
        made = simulate(model, self.controller, signals, self.robot.joint_names)
        self.q = made.q + 1e-8 * np.random.default_rng(0).standard_normal(made.q.shape)
        given = self.problem(made.tau)
        kinematics = estimate_kinematics(given.recordings[0], self.signals)
        self.tau = torque_of(given.regressor, kinematics, theta).T
        self.dq = kinematics.dq.T

    def problem(self, tau: np.ndarray) -> Problem:
        """The problem with a torque record [N m]."""
        recording = Recording("run", self.robot.joint_names, self.q, tau, 1000.0, q_ref=self.q_ref)
        loop = pv.Loop(self.controller)
        return Problem(self.robot, (recording,), loop, initial=self.truth)

    def noise(self, seed: int, std: float) -> np.ndarray:
        """AR(2) noise [N m]."""
        fresh = np.random.default_rng(seed).standard_normal((self.q.shape[0] + 200, 2))
        return lfilter([1.0], [1.0, -1.2, 0.5], std * fresh, axis=0)[200:]

    def unmodelled(self) -> np.ndarray:
        """Torque of a Stribeck effect that the model does not have [N m]."""
        return 0.3 * np.sign(self.dq) * np.exp(-((self.dq / 0.5) ** 2))


def piv_rejections(arm: PlanarArm, prefilter: str, runs: int, stribeck: bool) -> dict[str, float]:
    """Rejections of all tests on the residuals of IDIM-PIV, both joints together [%]."""
    method = PrefilteredIV(signals=arm.signals, prefilter=prefilter)  # type: ignore[arg-type]
    found: dict[str, list[float]] = {}
    for seed in range(runs):
        tau = arm.tau + arm.noise(seed, 0.05) + (arm.unmodelled() if stribeck else 0.0)
        for joint in residual_tests(pv.identify(arm.problem(tau), method)).joints:
            for name, test in joint.tests.items():
                found.setdefault(name, []).append(test.p_value)
    return {
        name: 100.0 * float(np.mean(np.array(p) < 0.05))
        for name, p in found.items()
        if not np.isnan(p).all()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--piv-runs", type=int, default=500)
    options = parser.parse_args()
    print(f"rejections at 5 % over {options.runs} records [%]; asked under the null: 3 to 7")
    for name, nulls, violation, p_value in CASES:
        sizes = "  ".join(f"{rejections(make, p_value, options.runs):5.1f}" for make in nulls)
        power = rejections(violation, p_value, options.runs)
        print(f"{name:36s} null {sizes:21s} power {power:5.1f}", flush=True)
    arm = PlanarArm()
    print(f"IDIM-PIV on {options.piv_runs} records of 2 s, both joints [%]")
    for prefilter in ("direct", "controller"):
        for stribeck in (False, True):
            rates = piv_rejections(arm, prefilter, options.piv_runs, stribeck)
            what = "Stribeck missing" if stribeck else "null"
            shown = "  ".join(f"{name} {rate:.1f}" for name, rate in rates.items())
            print(f"{prefilter:10s} {what:17s} {shown}", flush=True)


if __name__ == "__main__":
    main()
