"""What the paper's text leaves open, each with its alternatives; the defaults are the most literal.

A reading is one choice for each question. What no result depends on (the interval that the
likelihood is searched in, the diffuse start of the walk, how φ is computed) is not listed.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Reading:
    """One choice for each open question.

    second_pass: "by applying this simple routine twice" (4.2): the second pass takes its ratio
        from its "own" likelihood, or the "same" as the first.
    slopes: the slope of (27) is that to the next sample; as in the "state", or "centred".
    noise_of: H is the AR model of C⁻¹ε_τ, the noise of the "position" (29), and H_τ follows by
        (26); or the AR model is that of H_τ itself, as 4.4 says: of the "torque".
    exponent: L has λ⁻¹ in (22) and (28), so that ζᵀφ has λ⁻², where the optimum (23) and (31)
        have λ⁻¹: 1 as printed, 1/2 as (23) needs it.
    fit: AR models by "least squares", or by "burg".
    max_order: "very high order models" by AIC (5.1); where the search ends is not said.
    weak_integral: "the integral action is usually weak" (2.2): C⁻¹ has the integral (False), or
        is that of the controller without it (True), so that gravity stays in L φ.
    cut: C⁻¹ as it is (0), or with a Butterworth filter at this frequency in Hz.
    ridge: C⁻¹ as it is (0), or the inverse of C + ridge·C(∞), bounded where C is small.
    decimation: "n_m sampling points for the estimation" (5.2), so 1; but "artifacts introduced in
        the decimation" are in the noise (5.1): the factor of F_p and resampling before all else.
    joint_noise: a noise model for each axis, or one for all (False).
    smoother: the observation matrix by "irwsm", or by "bandpass" as for IDIM-IV.
    slowest: samples of a joint below this share of its largest speed are left out; the text says
        nothing of that, so 0.
    noise_moving: noise models come from all residuals, or only from those of samples in use.
    noise_fits: noise models are made anew in every iteration (0), or only in the first ones.
    variance_of: λ is that of the estimate "before", as (28) has it, or of "this" one, repeated.
    keep_orders: whether the orders are those of the first noise models.
    margins: seconds at both ends that sums and noise models leave out, where filters settle.
    forget: samples are left out until the prefilter has forgotten how it started but for this
        share; the text says nothing of that, so 0, all are in use.
    covariance: Ē in (31) is the "sum" over samples, or the "mean", which makes standard errors
        √n_m larger.
    axis_weights: IDIM-IV has L = F_p I, so that all axes weigh alike (False), or each by its
        residual (True), as is usual.
    begins: the auxiliary model starts where the "reference" does, or the "measured" motion.
    accelerations: the torque is held over each period, so that the acceleration of the auxiliary
        model steps at each sample: it is the "mean" of the two periods beside a sample, from the
        velocities, or from the positions, corrected to the "instant".
    dissipative: friction that was estimated negative is simulated so (False), or as none.
    halvings: where the auxiliary model cannot be simulated the iteration ends (0), or goes back
        half the way to the parameters before, at most so many times.
    stop: "until convergence is achieved" (4.3): the largest change of a parameter in its standard
        errors below which it is; another rule is a share of the parameter.
    max_iterations: where an iteration that goes on is given up.
    """

    second_pass: str = "own"
    slopes: str = "state"
    noise_of: str = "position"
    exponent: float = 1.0
    fit: str = "least squares"
    max_order: int = 100
    weak_integral: bool = False
    cut: float = 0.0
    ridge: float = 0.0
    decimation: int = 1
    joint_noise: bool = True
    smoother: str = "irwsm"
    slowest: float = 0.0
    noise_moving: bool = False
    noise_fits: int = 0
    variance_of: str = "before"
    keep_orders: bool = False
    margins: tuple[float, float] = (0.0, 0.0)
    forget: float = 0.0
    covariance: str = "sum"
    axis_weights: bool = False
    begins: str = "reference"
    accelerations: str = "mean"
    dissipative: bool = False
    halvings: int = 0
    stop: float = 0.01
    max_iterations: int = 20
