"""Series drawn from the model that the charts assume, or with a change in it."""

import numpy as np

from pivident.studies.many.fleet.series import Series


def drawn(
    rng,
    robots=6,
    records=6,
    baseline=3,
    scatter=0.02,
    std=0.01,
    warmth=None,
    levels=None,
    name="fc1",
):
    """One parameter of some robots; ``warmth`` is its slope over temperature, None without any."""
    levels = 2.0 + 0.2 * rng.standard_normal(robots) if levels is None else levels
    made = []
    for r in range(robots):
        s = std * rng.uniform(0.7, 1.5, records)
        t = 30.0 + 5.0 * rng.standard_normal(records)
        y = levels[r] + scatter * rng.standard_normal(records) + s * rng.standard_normal(records)
        if warmth is not None:
            y += warmth * (t - 30.0)
        made.append(
            Series(
                f"arm_{r}",
                name,
                "joint_1",
                "N m",
                tuple(f"arm_{r}/{k}" for k in range(records)),
                tuple(str(k) for k in range(records)),
                np.arange(records, dtype=float),
                y,
                s,
                t if warmth is not None else np.full(records, np.nan),
                baseline,
            )
        )
    return made


def changed(series, since, factor):
    """The same with values multiplied from one record on."""
    from dataclasses import replace

    value = series.value.copy()
    value[since:] *= factor
    return replace(series, value=value)
