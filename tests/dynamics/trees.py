"""Random trees of links, here and in Pinocchio, for tests of the dynamics."""

import numpy as np
import pinocchio as pin

from pivident.robot.frames import rotation_from_z_to
from pivident.robot.inertia import moved
from pivident.robot.urdf import parse_urdf
from pivident.robot.urdf_xml import parse_model
from tests.robot.test_urdf_against_pinocchio import pinocchio_configuration, random_urdf


class RandomTree:
    """A random robot twice, or that of a URDF: ``robot`` is ours, ``model`` Pinocchio's.

    Attributes:
        rng: the generator it came from, for states.
        inertia: ten parameters of each link in our frames, shape (joints, 10).
    """

    def __init__(self, seed, largest=9, text=None):
        self.rng = np.random.default_rng(seed)
        self.text = text or random_urdf(self.rng, int(self.rng.integers(1, largest + 1)))
        self.robot = parse_urdf(self.text)
        self.model = pin.buildModelFromXML(self.text)
        self.data = self.model.createData()
        self.inertia = np.array([link.inertia for link in self.robot.links])
        joints = [self.model.joints[self.model.getJointId(n)] for n in self.robot.joint_names]
        self._order = np.array([joint.idx_v for joint in joints])

    def states(self, count):
        """Random ``q dq ddq``, each (count, joints)."""
        return self.rng.uniform(-2.0, 2.0, (3, count, self.robot.size))

    def draw_inertias(self):
        """Give both robots other inertial parameters: any ten numbers, the mass positive."""
        axes = {joint.name: joint.axis for joint in parse_model(self.text).joints}
        self.inertia = self.rng.uniform(-1.0, 1.0, self.inertia.shape)
        self.inertia[:, 9] += 2.0
        for ours, name in zip(self.inertia, self.robot.joint_names, strict=True):
            xx, xy, xz, yy, yz, zz, mx, my, mz, m = moved(
                ours, rotation_from_z_to(axes[name]), np.zeros(3)
            )
            index = self.model.getJointId(name)
            self.model.inertias[index] = pin.Inertia.FromDynamicParameters(
                np.array([m, mx, my, mz, xx, xy, yy, xz, yz, zz])
            )

    def configuration(self, q):
        """Pinocchio's configuration of our positions."""
        return pinocchio_configuration(
            self.model, dict(zip(self.robot.joint_names, q, strict=True))
        )

    def theirs(self, vector):
        """A joint vector in Pinocchio's order."""
        out = np.zeros(self.model.nv)
        out[self._order] = vector
        return out

    def rnea(self, q, dq, ddq):
        """Torques by Pinocchio, all arguments (states, joints)."""
        rows = zip(q, dq, ddq, strict=True)
        return np.array(
            [
                pin.rnea(
                    self.model, self.data, self.configuration(a), self.theirs(b), self.theirs(c)
                )[self._order]
                for a, b, c in rows
            ]
        )

    def aba(self, q, dq, tau):
        """Accelerations by Pinocchio."""
        rows = zip(q, dq, tau, strict=True)
        return np.array(
            [
                pin.aba(
                    self.model, self.data, self.configuration(a), self.theirs(b), self.theirs(c)
                )[self._order]
                for a, b, c in rows
            ]
        )

    def crba(self, q):
        """Mass matrices by Pinocchio."""
        grid = np.ix_(self._order, self._order)
        out = []
        for a in q:
            upper = np.triu(pin.crba(self.model, self.data, self.configuration(a)))
            out.append((upper + np.triu(upper, 1).T)[grid])
        return np.array(out)

    def rnea_derivatives(self, q, dq, ddq):
        """∂τ/∂q, ∂τ/∂dq and M by Pinocchio, each (states, joints, joints)."""
        grid = np.ix_(self._order, self._order)
        found = []
        for a, b, c in zip(q, dq, ddq, strict=True):
            pin.computeRNEADerivatives(
                self.model, self.data, self.configuration(a), self.theirs(b), self.theirs(c)
            )
            mass = np.triu(self.data.M)
            mass = mass + np.triu(mass, 1).T
            found.append([m[grid] for m in (self.data.dtau_dq, self.data.dtau_dv, mass)])
        return np.array(found).swapaxes(0, 1)
