"""Rows of two joints with known parameters."""

import numpy as np

from pivident.estimation.literature.rows import JointRows, Rows

COUNT = 4000
COLUMNS = (np.array([0, 1, 2]), np.array([1, 2, 3]))
TRUTH = np.array([2.0, -0.7, 1.3, 0.4])


def rows_of(phi, tau, used=None, root=(1.0, 1.0)):
    """Rows of given columns and torques, two joints, divided by √λ."""
    joints = []
    for j, columns in enumerate(COLUMNS):
        keep = np.ones(tau[j].size, bool) if used is None else used[j]
        joints.append(
            JointRows(
                f"joint {j + 1}", columns, phi[j] * keep / root[j], tau[j] * keep / root[j], keep
            )
        )
    return Rows(tuple(joints), TRUTH.size, np.array(root), (tau[0].size,))


def made(seed=0, noise=0.1, count=COUNT):
    """Columns, torques without noise, and noise."""
    rng = np.random.default_rng(seed)
    phi = [rng.normal(size=(3, count)) * [[1.0], [0.5], [2.0]] for _ in range(2)]
    tau = [TRUTH[c] @ own for c, own in zip(COLUMNS, phi, strict=True)]
    return phi, tau, noise * rng.normal(size=(2, count)), rng


def stacked(rows):
    """All rows below each other, dense: Φ and τ."""
    phi = []
    for own in rows.joints:
        wide = np.zeros((own.tau.size, rows.size))
        wide[:, own.columns] = own.phi.T
        phi.append(wide[own.used])
    return np.vstack(phi), np.concatenate([own.tau[own.used] for own in rows.joints])
