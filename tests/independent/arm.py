"""The Stäubli TX40 with the paper's 28 parameters: torques linear in them, by Newton and Euler.

Frames are Khalil's modified ones; a body's inertia and first moment are taken at the origin of its
frame, so that forces and moments are linear in them. Nothing here is taken from pivident.
"""

import numba
import numpy as np

GRAVITY = 9.81  # m/s²
GAMMA = 150.0  # s/rad: the arctangent in place of the sign of the velocity
NAMES = tuple(
    "ZZ1 fv1 fc1 XX2 XZ2 ZZ2 MX2 fv2 fc2 XX3 ZZ3 MY3 Ia3 fv3 fc3 MX4 Ia4 fv4 fc4 "
    "MY5 Ia5 fv5 fc5 Ia6 fv6 fc6 fvm6 fcm6".split()
)
KINDS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "Ia", "fv", "fc", "fvm", "fcm")
COLUMNS = np.array([[KINDS.index(name[:-1]), int(name[-1]) - 1] for name in NAMES])
ROTOR, VISCOUS, COULOMB, VISCOUS_MOTOR, COULOMB_MOTOR = range(KINDS.index("Ia"), len(KINDS))
ALPHA = np.pi / 2 * np.array([0.0, -1, 0, 1, -1, 1])
A = np.array([0.0, 0, 0.225, 0, 0, 0])
D = np.array([0.0, 0, 0.035, 0.225, 0, 0])
OFFSET = np.pi / 2 * np.array([0.0, -1, 1, 0, 0, 2])


@numba.njit(cache=True)
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@numba.njit(cache=True)
def plus(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@numba.njit(cache=True)
def into(axes, v):
    """Components in the frame of the link of a vector given in the frame before it."""
    return (
        axes[0, 0] * v[0] + axes[1, 0] * v[1] + axes[2, 0] * v[2],
        axes[0, 1] * v[0] + axes[1, 1] * v[1] + axes[2, 1] * v[2],
        axes[0, 2] * v[0] + axes[1, 2] * v[1] + axes[2, 2] * v[2],
    )


@numba.njit(cache=True)
def out_of(axes, v):
    """Components in the frame before the link of a vector given in the frame of the link."""
    return (
        axes[0, 0] * v[0] + axes[0, 1] * v[1] + axes[0, 2] * v[2],
        axes[1, 0] * v[0] + axes[1, 1] * v[1] + axes[1, 2] * v[2],
        axes[2, 0] * v[0] + axes[2, 1] * v[1] + axes[2, 2] * v[2],
    )


@numba.njit(cache=True)
def inertia_times(kind, v):
    """J v for the inertia matrix in which only the entry named by kind is 1."""
    if kind == 0:
        return v[0], 0.0, 0.0
    if kind == 1:
        return v[1], v[0], 0.0
    if kind == 2:
        return v[2], 0.0, v[0]
    if kind == 3:
        return 0.0, v[1], 0.0
    if kind == 4:
        return 0.0, v[2], v[1]
    return 0.0, 0.0, v[2]


@numba.njit(cache=True)
def rows(q, dq, ddq, gravity, friction, columns, axes, phi):
    """φ(q, dq, ddq) of one sample, shape (joints, parameters), into phi; axes is room."""
    joints = len(q)
    phi[:] = 0.0
    zero = (0.0, 0.0, 0.0)
    turn, spin, lift = zero, zero, (0.0, 0.0, gravity)
    for j in range(joints):
        c, s = np.cos(q[j] + OFFSET[j]), np.sin(q[j] + OFFSET[j])
        ca, sa = np.cos(ALPHA[j]), np.sin(ALPHA[j])
        axes[j, 0, 0], axes[j, 0, 1], axes[j, 0, 2] = c, -s, 0.0
        axes[j, 1, 0], axes[j, 1, 1], axes[j, 1, 2] = s * ca, c * ca, -sa
        axes[j, 2, 0], axes[j, 2, 1], axes[j, 2, 2] = s * sa, c * sa, ca
        place = (A[j], -sa * D[j], ca * D[j])
        lift = into(axes[j], plus(lift, plus(cross(spin, place), cross(turn, cross(turn, place)))))
        carried = into(axes[j], turn)
        spin = plus(
            into(axes[j], spin), plus(cross(carried, (0.0, 0.0, dq[j])), (0.0, 0.0, ddq[j]))
        )
        turn = plus(carried, (0.0, 0.0, dq[j]))
        for k in range(len(columns)):
            kind = columns[k, 0]
            if columns[k, 1] != j or kind >= ROTOR:
                continue
            force, moment = zero, zero
            if kind < 6:
                moment = plus(inertia_times(kind, spin), cross(turn, inertia_times(kind, turn)))
            else:
                arm = (1.0 * (kind == 6), 1.0 * (kind == 7), 1.0 * (kind == 8))
                force = plus(cross(spin, arm), cross(turn, cross(turn, arm)))
                moment = cross(arm, lift)
            for i in range(j, -1, -1):
                phi[i, k] = moment[2]
                force = out_of(axes[i], force)
                offset = (A[i], -np.sin(ALPHA[i]) * D[i], np.cos(ALPHA[i]) * D[i])
                moment = plus(out_of(axes[i], moment), cross(offset, force))
    for k in range(len(columns)):
        kind, j = columns[k]
        if kind == ROTOR:
            phi[j, k] = ddq[j]
        elif friction and kind == VISCOUS:
            phi[j, k] = dq[j]
        elif friction and kind == COULOMB:
            phi[j, k] = 2 / np.pi * np.arctan(GAMMA * dq[j])
        elif friction and kind == VISCOUS_MOTOR:
            phi[4, k], phi[5, k] = dq[5], dq[4]
        elif friction and kind == COULOMB_MOTOR:
            phi[4, k] = phi[5, k] = 2 / np.pi * np.arctan(GAMMA * (dq[4] + dq[5]))


@numba.njit(cache=True)
def observation_matrix(q, dq, ddq, columns):
    """φ of all samples, shape (joints, parameters, samples); signals are (samples, joints)."""
    samples, joints = q.shape
    phi = np.empty((joints, len(columns), samples))
    axes, at = np.empty((joints, 3, 3)), np.empty((joints, len(columns)))
    for i in range(samples):
        rows(q[i], dq[i], ddq[i], GRAVITY, True, columns, axes, at)
        phi[:, :, i] = at
    return phi


def observed(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """φ of the 28 parameters, shape (joints, parameters, samples)."""
    return observation_matrix(q, dq, ddq, COLUMNS)
