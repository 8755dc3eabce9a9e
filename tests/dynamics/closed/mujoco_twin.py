"""A mechanism of ours in MuJoCo: the same tree, closures as points that connect."""

from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from pivident.robot.frames import Pose
from pivident.robot.inertia import Body

#: Points of the two frames that have to meet, in their own axes.
POINTS = {"point": ((0, 0, 0),), "axis": ((0, 0, 0), (0, 0, 1)), "full": np.eye(4, 3, -1)}


def numbers(values):
    return '"' + " ".join(repr(float(v)) for v in np.ravel(values)) + '"'


class Twin:
    """The tree of a robot as a MuJoCo model, its loops as equality constraints.

    Links that are no bodies become further joints of the body that hangs on them.
    """

    def __init__(self, robot, damping=()):
        self.robot, self.tree = robot, robot.tree
        self.damping = damping if len(damping) else np.zeros(self.tree.size)
        children = {i: [] for i in range(-1, self.tree.size)}
        for i, joint in enumerate(self.tree.joints):
            children[joint.parent].append(i)
        self._children = children
        self._ends, equalities = {i: [] for i in children}, []
        for closure in robot.constraints.closures:
            for k, point in enumerate(POINTS[closure.kind]):
                names = []
                for end, (link, frame) in enumerate(
                    zip(closure.links, closure.frames, strict=True)
                ):
                    names.append(f"{closure.name} {k} {end}")
                    place = frame.translation + frame.rotation @ np.array(point, float)
                    self._ends[link].append((names[-1], place))
                equalities.append(
                    f"<connect site1={quoteattr(names[0])} site2={quoteattr(names[1])}/>"
                )
        for one in robot.constraints.linear:
            driven, driving = np.flatnonzero(one.ratios)[::-1]
            assert one.ratios[driven] == 1.0
            coefficients = [one.offset, -one.ratios[driving], 0, 0, 0]
            equalities.append(
                f'<joint joint1="{self.tree.joints[driven].name}" '
                f'joint2="{self.tree.joints[driving].name}" polycoef={numbers(coefficients)}/>'
            )
        bodies = "".join(self._body(i, Pose.identity(), []) for i in children[-1])
        self.model = mujoco.MjModel.from_xml_string(
            f"<mujoco><compiler angle='radian'/><option gravity={numbers(self.tree.gravity)} "
            "jacobian='dense'><flag energy='enable'/></option><worldbody>"
            f"{self._sites(-1)}{bodies}</worldbody>"
            f"<equality>{''.join(equalities)}</equality></mujoco>"
        )
        self.data = mujoco.MjData(self.model)
        order = [self.model.joint(joint.name).dofadr[0] for joint in self.tree.joints]
        assert order == list(range(self.tree.size))

    def _sites(self, link):
        return "".join(
            f"<site name={quoteattr(name)} pos={numbers(place)}/>"
            for name, place in self._ends[link]
        )

    def _body(self, i, before, axes):
        """XML of a link and what hangs on it; ``axes``: joints before it that share its body."""
        joint, link = self.tree.joints[i], self.tree.links[i]
        mount = Pose(joint.rotation, joint.translation)
        here = before @ mount
        back = Pose(mount.rotation.T, -mount.rotation.T @ mount.translation)
        axes = [(k, back @ pose) for k, pose in axes] + [(i, Pose.identity())]
        if not link.is_body:
            (child,) = self._children[i]
            return self._body(child, here, axes)
        body = Body.of_parameters(link.inertia)
        moment = body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        joints = "".join(
            f"<joint name={quoteattr(self.tree.joints[k].name)} "
            f'type="{"slide" if self.tree.joints[k].kind == "prismatic" else "hinge"}" '
            f"pos={numbers(pose.translation)} axis={numbers(pose.rotation[:, 2])} "
            f"armature={numbers(self.tree.rotor_inertia[k])} damping={numbers(self.damping[k])}/>"
            for k, pose in axes
        )
        inner = "".join(self._body(child, Pose.identity(), []) for child in self._children[i])
        return (
            f"<body pos={numbers(here.translation)} xyaxes={numbers(here.rotation[:, :2].T)}>"
            f"<inertial pos={numbers(body.center_of_mass)} mass={numbers(body.mass)} "
            f"fullinertia={numbers(moment)}/>{joints}{self._sites(i)}{inner}</body>"
        )

    def place(self, q, dq):
        """Bring it to positions and speeds of all joints."""
        self.data.qpos[:], self.data.qvel[:] = q, dq
        mujoco.mj_forward(self.model, self.data)

    def jacobian(self, q, dq):
        """Rows of the equality constraints, (rows, tree joints), and how far they are open."""
        self.place(q, dq)
        rows = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        slope = self.data.efc_J.reshape(-1, self.model.nv)[rows]
        return slope.copy(), self.data.efc_pos[rows].copy()

    def drift(self, q, dq, step=1e-5):
        """DA/dt dq by differences of its Jacobian."""
        ahead, behind = (self.jacobian(q + h * dq, dq)[0] for h in (step, -step))
        return (ahead - behind) @ dq / (2.0 * step)

    def mass_and_bias(self, q, dq):
        """M, and Coriolis, gravity and damping."""
        self.place(q, dq)
        mass = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, mass)
        return mass, self.data.qfrc_bias - self.data.qfrc_passive

    def energy(self, q, dq):
        """Potential and kinetic energy [J]."""
        self.place(q, dq)
        return self.data.energy.copy()
