"""Closed loops of MJCF files against MuJoCo's own constraints, and what is refused."""

import mujoco
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings, strategies as st

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.robot_regressor import regressor_of
from pivident.experiment.file_keys import RobotEntry
from pivident.experiment.init.kept_joints import robot_file
from pivident.experiment.robot_table import robot_of
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.mjcf import read_mjcf
from tests.robot.test_mjcf import arm, unit, without_dry_friction, written

STATES = 5


def engine_states(path, robot, frozen=(), seed=0, reach=0.15):
    """Torques of MuJoCo with its constraints projected out, N, and the largest gap, at states."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data, chains = mujoco.MjData(model), ClosedChains(robot)
    names = [joint.name for joint in robot.tree.joints]
    at_q = [model.joint(name).qposadr[0] for name in names]
    at_v = [model.joint(name).dofadr[0] for name in names]
    for name, position in dict(frozen).items():
        data.qpos[model.joint(name).qposadr[0]] = position
    rng = np.random.default_rng(seed)
    middle = robot.constraints.posture[list(robot.places)]
    q, dq, ddq = rng.uniform(-reach, reach, (3, STATES, robot.size))
    q = q + middle
    tau, gains, gap = np.empty_like(q), [], 0.0
    for k in range(STATES):
        motion = chains.motion(q[k][:, None], dq[k][:, None], ddq[k][:, None])
        data.qpos[at_q], data.qvel[at_v], data.qacc[at_v] = (x[:, 0] for x in motion[:3])
        model.opt.disableflags = 0
        mujoco.mj_fwdPosition(model, data)
        rows = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        slope = data.efc_J.reshape(-1, model.nv)[: data.nefc][rows][:, at_v]
        gap = max(gap, np.abs(data.efc_pos[: data.nefc][rows]).max(initial=0.0))
        free = scipy.linalg.null_space(slope, rcond=1e-9)
        assert free.shape[1] == robot.size
        gain = free @ np.linalg.inv(free[list(robot.places)])
        model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        mujoco.mj_inverse(model, data)
        tau[k] = gain.T @ data.qfrc_inverse[at_v]
        gains.append(np.abs(gain - motion.gain[:, :, 0]).max())
    return (q, dq, ddq), tau, max(gains), gap


def check_against_mujoco(path, robot, frozen=(), **options):
    states, tau, gain, gap = engine_states(path, robot, frozen, **options)
    parameters, values = without_dry_friction(robot)
    ours = regressor_of(robot, parameters).torque(*states, values)
    np.testing.assert_allclose(ours, tau, rtol=0, atol=1e-8 * (1 + np.abs(tau).max()))
    assert gain < 1e-8 and gap < 1e-9


def random_loop(rng, kind, between):
    """Two random chains whose ends an equality closes in the drawn pose."""
    spec = mujoco.MjSpec()
    spec.option.gravity = rng.uniform(-10, 10, 3)
    spec.compiler.degree = False
    ends, joints = [], 0
    for chain in range(2):
        body = spec.worldbody
        for b in range(4 if kind == "weld" else 3):
            body = body.add_body(
                name=f"{'ab'[chain]}{b}", pos=rng.uniform(-1, 1, 3), quat=rng.normal(size=4)
            )
            body.mass, body.inertia = rng.uniform(0.5, 3.0), rng.uniform(0.5, 1.0, 3)
            body.explicitinertial, body.ipos = True, rng.uniform(-0.3, 0.3, 3)
            for _ in range(1 if b != 1 else 2):
                slides = rng.random() < 0.2
                joint = body.add_joint(
                    name=f"j{joints}",
                    type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
                    pos=rng.uniform(-0.3, 0.3, 3),
                    axis=unit(rng.normal(size=3)),
                    ref=rng.uniform(-1, 1),
                )
                joint.damping[0] = rng.uniform(0, 2)
                joints += 1
        # the last one is fixed to the others
        ends.append(body.add_body(name=f"tip{chain}", pos=rng.uniform(-0.3, 0.3, 3)))
        ends[-1].mass, ends[-1].inertia, ends[-1].explicitinertial = 0.5, [0.1, 0.1, 0.1], True
    names = [end.name for end in ends]
    equality = spec.add_equality(
        name="loop",
        type=mujoco.mjtEq.mjEQ_CONNECT if kind == "connect" else mujoco.mjtEq.mjEQ_WELD,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1=names[0],
        name2=names[1],
    )
    if between == "bodies":
        data = np.array(equality.data)
        data[:3] = rng.uniform(-0.2, 0.2, 3)
        equality.data = data
        return spec, joints
    drawn = spec.compile()
    state = mujoco.MjData(drawn)
    mujoco.mj_kinematics(drawn, state)
    first, second = (state.body(name) for name in names)
    turn, place = unit(rng.normal(size=4)), rng.uniform(-0.2, 0.2, 3)
    ends[0].add_site(name="s0", pos=place, quat=turn)
    world = first.xpos + first.xmat.reshape(3, 3) @ place
    whole, back, own = np.zeros(4), np.zeros(4), np.zeros(4)
    mujoco.mju_mulQuat(whole, first.xquat, turn)
    mujoco.mju_negQuat(back, second.xquat)
    mujoco.mju_mulQuat(own, back, whole)
    ends[1].add_site(name="s1", pos=second.xmat.reshape(3, 3).T @ (world - second.xpos), quat=own)
    equality.objtype, equality.name1, equality.name2 = mujoco.mjtObj.mjOBJ_SITE, "s0", "s1"
    return spec, joints


@pytest.mark.parametrize("between", ["bodies", "sites"])
@pytest.mark.parametrize("kind", ["connect", "weld"])
@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_loops_have_mujocos_dynamics(tmp_path_factory, kind, between, seed):
    rng = np.random.default_rng(seed)
    spec, joints = random_loop(rng, kind, between)
    equations = 3 if kind == "connect" else 6
    path = written(spec, tmp_path_factory.mktemp("loop"))
    robot, best = None, 1e-2
    for _ in range(20):  # joints that the loop moves well in the drawn pose
        passive = [f"j{k}" for k in rng.choice(joints, equations, replace=False)]
        model = mujoco.MjModel.from_xml_path(str(path))
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        data = mujoco.MjData(model)
        mujoco.mj_fwdPosition(model, data)
        slope = data.efc_J.reshape(-1, model.nv)[: data.nefc]
        columns = [model.joint(name).dofadr[0] for name in passive]
        least = np.linalg.svd(slope[:, columns], compute_uv=False)[-1]
        if least > best:
            robot, best = passive, least
    if robot is None:
        return
    read = read_mjcf(path, passive=robot)
    assert [joint.name for joint in read.passive_joints] == sorted(robot, key=lambda n: int(n[1:]))
    assert read.constraints.closures[0].kind == ("point" if kind == "connect" else "full")
    check_against_mujoco(path, read, reach=0.02 * min(1.0, best))


#: Two cranks, drawn apart where they are not: `ref` of the first, the tip closed in the drawn pose.
FIVE_BAR = """<mujoco model="five bar"><compiler angle="radian"/><option gravity="0 0 -9.81"/>
<default><joint axis="0 -1 0"/></default><worldbody>
<body name="A1"><joint name="a1" ref="2.0" armature=".1" damping=".3"/>
 <inertial pos=".2 0 0.1" mass="1" diaginertia=".1 .1 .1"/>
 <body name="A2" pos="-.1665 0 .3637"><joint name="a2" damping=".2" frictionloss=".1"/>
  <inertial pos=".2 0 0" mass="1" diaginertia=".1 .1 .1"/></body></body>
<body name="B1" pos=".3 0 0"><joint name="b1" armature=".05"/>
 <inertial pos=".2 0 0" mass="1" diaginertia=".1 .1 .1"/>
 <body name="B2" pos=".35 0 .1"><joint name="b2"{passive}/>
  <inertial pos=".1 0 .3" mass="1" diaginertia=".1 .1 .1"/>
  <body name="hand" pos="0 0 .3"><joint name="wrist" axis="1 0 0"/>
   <inertial pos=".1 0 .1" mass=".5" diaginertia=".01 .01 .01"/></body></body></body>
</worldbody><equality>{equality}</equality>{more}</mujoco>"""

TIP = '<connect name="tip" body1="A2" body2="B2" anchor=".5 0 .05"/>'
MOTORS = (
    '<actuator><motor joint="a1"/><position joint="b1" kp="5"/><motor joint="wrist"/></actuator>'
)


def five_bar(folder, equality=TIP, more=MOTORS, passive=""):
    path = folder / "five_bar.xml"
    path.write_text(FIVE_BAR.format(equality=equality, more=more, passive=passive))
    return path


def test_actuators_say_which_joints_have_motors(tmp_path):
    path = five_bar(tmp_path)
    robot = read_mjcf(path)
    assert robot.joint_names == ("a1", "b1", "wrist")
    assert robot.tree.joint_names == ("a1", "a2", "b1", "b2", "wrist")
    np.testing.assert_array_equal(robot.rotor_inertia, [0.1, 0.05, 0.0])
    np.testing.assert_allclose(robot.constraints.posture, [2.0, 0, 0, 0, 0], atol=1e-12)
    assert robot.constraints.redundant == ("1 of 'tip'",)
    check_against_mujoco(path, robot)


def test_passive_joints_have_the_friction_that_the_file_has_values_for(tmp_path):
    robot = read_mjcf(five_bar(tmp_path))
    stems = {j.name: [t.stem for t in j.friction.terms] for j in robot.tree.joints}
    assert stems["a2"] == ["fv", "fc"] and stems["b2"] == []
    assert robot.friction_nominal == {"fv[a1]": 0.3, "fv[a2]": 0.2, "fc[a2]": 0.1}


def test_without_actuators_the_user_says_which_joints_have_none(tmp_path):
    path = five_bar(tmp_path, more="")
    with pytest.raises(
        RobotDescriptionError,
        match=r"couple the joints a1, a2, b1, b2, of which 2 follow the others; actuators, on none,"
        r" do not tell which.*passive = \[…\] under \[robot\]",
    ):
        read_mjcf(path)
    assert read_mjcf(path, passive=["a2", "b2"]).joint_names == ("a1", "b1", "wrist")
    with pytest.raises(RobotDescriptionError, match="no joint 'a3'"):
        read_mjcf(path, passive=["a3"])
    with pytest.raises(RobotDescriptionError, match=r"fewer independent.*without motors are a2"):
        read_mjcf(path, passive=["a2"])


def test_an_experiment_file_names_passive_joints(tmp_path):
    five_bar(tmp_path, more="")
    entry = RobotEntry(model="five_bar.xml", joints=["b1", "a1"], passive=["a2", "b2"])
    robot = robot_of(entry, tmp_path)
    assert robot.joint_names == ("b1", "a1")
    with pytest.raises(ValueError, match=r"passive is for MJCF robots, not for 'five_bar'"):
        RobotEntry(model="five_bar", passive=["left"])


def test_pivident_init_looks_for_the_joints_with_motors(tmp_path):
    machine = robot_file(str(five_bar(tmp_path)), [tmp_path / "log.csv"])
    assert machine.joint_names == ("a1", "b1", "wrist") and machine.fixed == ("a2", "b2")
    robot = machine.robot(["a1", "b1"], {"wrist": 0.2})
    assert robot.joint_names == ("a1", "b1") and len(robot.passive_joints) == 2


def test_joints_of_the_log_take_those_of_their_loop_along(tmp_path):
    path = five_bar(tmp_path)
    robot = read_mjcf(path, joints=["b1", "a1"], frozen={"wrist": 0.4})
    assert robot.joint_names == ("b1", "a1")
    assert robot.tree.joint_names == ("a1", "a2", "b1", "b2")
    check_against_mujoco(path, robot, frozen={"wrist": 0.4})
    other = read_mjcf(path, joints=["a1", "b1"])
    np.testing.assert_array_equal(robot.rotor_inertia, other.rotor_inertia[::-1])


def test_a_loop_whose_joints_all_stand_still_is_left_out(tmp_path):
    robot = read_mjcf(five_bar(tmp_path), joints=["wrist"], frozen={"a1": 2.0})
    assert robot.constraints is None and robot.joint_names == ("wrist",)
    with pytest.raises(RobotDescriptionError, match=r"'tip': its joints stand still.*m apart"):
        read_mjcf(five_bar(tmp_path), joints=["wrist"], frozen={"a1": 1.0})


def test_a_frozen_joint_is_a_shorter_loop(tmp_path):
    path = five_bar(tmp_path, more="")
    robot = read_mjcf(path, frozen={"a1": 1.9}, passive=["a2", "b2"])
    assert robot.joint_names == ("b1", "wrist")
    check_against_mujoco(path, robot, frozen={"a1": 1.9})


def test_what_the_file_switches_off_is_no_loop(tmp_path):
    off = TIP.replace("<connect ", '<connect active="false" ')
    robot = read_mjcf(five_bar(tmp_path, off))
    assert robot.constraints is None and robot.size == 5
    with pytest.raises(RobotDescriptionError, match="passive: a2 move by themselves"):
        read_mjcf(five_bar(tmp_path, off), passive=["a2"])


def test_a_hinge_of_the_base_held_by_a_weld_is_no_loop(tmp_path):
    weld = '<weld name="hung" body1="base"/>'
    path = arm(tmp_path, root='<freejoint name="root"/>', more=f"<equality>{weld}</equality>")
    robot = read_mjcf(path, frozen={"root": 0.0})
    assert robot.constraints is None and robot.joint_names == ("a", "b")


SITES = """<mujoco><compiler angle="radian"/><worldbody>
<body name="A"><joint name="a" axis="0 1 0"/>
<inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>
<body name="B" pos=".3 0 0"><joint name="b" axis="0 1 0"/>
<inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>
<site name="tip" pos=".5 0 0"/></body></body>
<body name="C" pos=".5 0 0"><joint name="c" axis="0 1 0"/>
<inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>
<site name="hook" pos=".4 0 0"/></body>
</worldbody><equality><connect name="pin" site1="tip" site2="hook"/></equality>
<actuator><motor joint="a"/></actuator>{key}</mujoco>"""


def test_a_keyframe_is_where_a_loop_that_is_drawn_open_starts(tmp_path):
    path = tmp_path / "four_bar.xml"
    path.write_text(SITES.format(key='<keyframe><key name="up" qpos="-1.2 1.1 -1.3"/></keyframe>'))
    robot = read_mjcf(path)
    np.testing.assert_allclose(robot.constraints.posture, [-1.2, 1.1, -1.3], atol=0.2)
    assert robot.constraints.posture[0] == -1.2
    check_against_mujoco(path, robot)
    path.write_text(SITES.format(key=""))  # the rods lie in one line, from which nothing closes
    with pytest.raises(RobotDescriptionError, match=r"'pin' does not close.* add a <key> in which"):
        read_mjcf(path)


GEARED = """<mujoco><compiler angle="radian"/><worldbody>
<body name="A"><joint name="a" axis="0 1 0" ref=".3" armature=".2"/>
<inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>
<body name="B" pos=".3 0 0"><joint name="b" axis="0 1 0" ref="-.2" armature=".01"/>
<inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>
<site name="o"/>
<body name="C" pos=".3 0 0"><joint name="c" type="slide" axis="1 0 0" ref=".1"/><site name="p"/>
<inertial pos=".1 0 .1" mass="1" diaginertia=".1 .1 .1"/></body></body></body>
</worldbody>{tendon}<equality>{equality}</equality>{more}</mujoco>"""

BELT = '<joint name="belt" joint1="b" joint2="a" polycoef=".1 -0.5 0 0 0"/>'
SUM = (
    '<tendon><fixed name="sum"><joint joint="a" coef="1"/><joint joint="b" coef="2"/>'
    '<joint joint="c" coef="-4"/></fixed></tendon>'
)


def geared(folder, equality=BELT, tendon="", more=""):
    path = folder / "geared.xml"
    path.write_text(GEARED.format(equality=equality, tendon=tendon, more=more))
    return path


def test_a_joint_that_is_a_straight_line_of_another_follows_it(tmp_path):
    path = geared(tmp_path)
    robot = read_mjcf(path)
    assert robot.joint_names == ("a", "c")
    whole = ClosedChains(robot).start(np.array([0.7, 0.0])).q
    np.testing.assert_allclose(whole, [0.7, -0.2 + 0.1 - 0.5 * 0.4, 0.0], atol=1e-14)
    # the follower's rotor turns half as fast
    np.testing.assert_allclose(robot.rotor_inertia, [0.2 + 0.25 * 0.01, 0.0])
    check_against_mujoco(path, robot)


def test_an_actuator_on_the_follower_makes_the_other_joint_passive(tmp_path):
    more = '<actuator><motor joint="b"/><motor joint="c"/></actuator>'
    robot = read_mjcf(geared(tmp_path, more=more))
    assert robot.joint_names == ("b", "c")
    np.testing.assert_allclose(robot.rotor_inertia, [0.01 + 4.0 * 0.2, 0.0])


def test_a_tendon_that_an_equality_holds_is_a_proportion(tmp_path):
    held = '<tendon name="hold" tendon1="sum" polycoef=".05 0 0 0 0"/>'
    path = geared(tmp_path, equality=held, tendon=SUM)
    robot = read_mjcf(path, passive=["c"])
    (one,) = robot.constraints.linear
    np.testing.assert_array_equal(one.ratios, [1.0, 2.0, -4.0])
    assert one.offset == pytest.approx(0.3 - 0.4 - 0.4 + 0.05)
    check_against_mujoco(path, robot)
    with pytest.raises(RobotDescriptionError, match=r"a, b, c, of which 1 follow.*on none"):
        read_mjcf(path)


def test_a_joint_that_an_equality_holds_stands_still(tmp_path):
    path = geared(tmp_path, equality='<joint name="brake" joint1="b" polycoef=".4 0 0 0 0"/>')
    robot = read_mjcf(path)
    assert robot.joint_names == ("a", "c")
    assert ClosedChains(robot).start(np.array([0.5, 0.1])).q[1] == pytest.approx(0.2)


def test_frozen_followers_and_leaders(tmp_path):
    robot = read_mjcf(geared(tmp_path), frozen={"b": 0.1})
    assert robot.constraints is None and robot.joint_names == ("a", "c")
    with pytest.raises(RobotDescriptionError, match=r"'belt': joint 'b' follows 'a'.*freeze it"):
        read_mjcf(geared(tmp_path), frozen={"a": 0.1})
    along = read_mjcf(geared(tmp_path), joints=["a"])
    assert along.joint_names == ("a",) and along.tree.joint_names == ("a", "b")


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (
            {"equality": BELT.replace("-0.5 0", "-0.5 0.2")},
            r"equality 'belt': a polynomial of a degree above one \(polycoef = 0\.1 -0\.5 0\.2",
        ),
        ({"tendon": SUM}, r"tendons \(sum\)"),
        (
            {
                "tendon": '<tendon><spatial name="rope"><site site="o"/><site site="p"/></spatial>'
                "</tendon>",
                "equality": '<tendon tendon1="rope"/>',
            },
            r"tendon 'rope' is no sum of joint positions",
        ),
        (
            {
                "tendon": SUM.replace('"sum"', '"sum" damping="1"'),
                "equality": '<tendon tendon1="sum"/>',
            },
            r"tendons \(sum\)",
        ),
    ],
)
def test_what_is_no_proportion_is_refused(tmp_path, given, says):
    with pytest.raises(RobotDescriptionError, match=f"geared.xml: .*{says}"):
        read_mjcf(geared(tmp_path, **given))


def test_a_tendon_of_joints_that_stand_still_does_nothing(tmp_path):
    """As the fingers of many arms: a tendon with a motor, and an equality."""
    more = '<actuator><general tendon="sum"/><motor joint="a"/></actuator>'
    equality = '<joint joint1="b" joint2="c"/>'
    joints = SUM.replace('<joint joint="a" coef="1"/>', "")
    path = geared(tmp_path, equality=equality, tendon=joints, more=more)
    robot = read_mjcf(path, joints=["a"])
    assert robot.joint_names == ("a",) and robot.constraints is None
    with pytest.raises(RobotDescriptionError, match=r"tendons \(sum\)"):
        read_mjcf(path)


def test_a_rotor_that_a_loop_moves_is_refused(tmp_path):
    with pytest.raises(RobotDescriptionError, match=r"'b2' has armature = 0\.3 but no motor"):
        read_mjcf(five_bar(tmp_path, passive=' armature=".3"'))
