"""Names in the documentation that are not pivident's, or are none, each with the reason.

A test fails for an entry that is no longer needed: one that its pages no longer have, or that is
resolved by itself.
"""

from __future__ import annotations

import fnmatch
from dataclasses import dataclass


@dataclass(frozen=True)
class Listed:
    """Texts of code spans, separated by two spaces or line ends, on pages of a pattern."""

    reason: str
    pages: str
    texts: str

    @property
    def names(self) -> frozenset[str]:
        return frozenset(
            text.strip() for line in self.texts.splitlines() for text in line.split("  ") if text
        )

    def has(self, text: str, page: str) -> bool:
        return text in self.names and fnmatch.fnmatch(page, self.pages)


LISTED = (
    Listed(
        "channels and classes of other loggers and drives",
        "docs/how_to/loggers.md",
        """
        MotorState.msg  robot_state.h  feedBack.joints  observation.state  planned.joints
        BaseCyclic  GearTorque
        LowState  MotorState  RobotState  abb_libegm  action  actual_current  actual_q
        actual_qd  current_motor
        fer_joint1  fr3_joint1  panda_joint1  getCommandedJointPosition  getExternalTorque
        getMeasuredJointPosition  getMeasuredTorque  goal_position  joint_position_measured
        joint_temperatures
        present_current  present_load  present_position  present_temperature  q_d
        target_current  target_moment
        target_q  tau_J  tau_J_d  tau_est  temperature_motor  timestamp  use_currents_as_efforts
        """,
    ),
    Listed(
        "columns of a log of somebody's",
        "*",
        """
        axis_1.actPos  pos[0]  tau_J[0]  actual_q_0  cmd  des  ext  gtau  kt  q_1  ref  tcp
        arm_3_joint_effort
        q = ["A1_Ist", …]  q = ["actual_q_0", …]  q_ref = ["target_q_0", …]  t = "Zeit"
        t = "__time"
        t = "timestamp"  tau = ["actual_current_0", …]  sensors = ["tau_J_1", …]
        temperature = ["T1", "T2"]
        Zeit;A1_Ist;…  __time,/joint_states/elbow/position,…  time,q[0],…,tau_J[0],…
        timestamp actual_q_0 … actual_current_0 …
        """,
    ),
    Listed(
        "joints, links, files, methods and results of somebody's",
        "*",
        """
        -NAME  [consistency.bounds.link_3]  passive = ["elbow", "rod"]
        trusted = {joint_2 = 32.0}  joint1  leg-simulator
        axis_3, length along x from axis_2 to axis_3: 0.98 ± 0.02 mm
        3 per revolution of the motor of joint_4
        logs/arm_07/2026-03-01.csv  high-soft  high-stiff  low-soft  low-stiff
        """,
    ),
    Listed(
        "names in a program or file that pivident writes, made of the robot's name and joints",
        "*",
        """
        arm_inverse_dynamics(q, dq, ddq, tau)    ax3  dwx3  uxy3  wx3
        minus_ax3
        inverse_model_samples  my_robot_closed_posture  my_robot_inverse_model  zzr_left_elbow
        PC-IDIM-PIV
        pivident_motion_slow.script  trajectory_slow.yaml
        """,
    ),
    Listed(
        "options of compilers",
        "docs/*",
        "-O2  -O3 -march=native  -Wall -Wextra -pedantic  -ffast-math  -fno-math-errno",
    ),
    Listed(
        "elements, attributes and functions of MuJoCo and Isaac",
        "*",
        """
        DelayedPDActuator  DelayedPDActuatorCfg  ctrl  ctrlrange  equality  forcerange  general
        mj_resetData  solimpfriction  solref  solreffriction  sysid  unidentifiable
        """,
    ),
    Listed(
        "messages and topics of ROS",
        "*",
        """
        JointTrajectory  trajectory_msgs/JointTrajectory  trajectory_msgs/msg/JointTrajectory
        sensor_msgs/JointState  control_msgs/JointTrajectoryControllerState
        "/joint_states/position"  "/left/joint_states/position"  ros2 bag record /joint_states
        """,
    ),
    Listed(
        "a robot that is not there", "docs/questions.md", "check experiment.toml --robot planar_2"
    ),
    Listed(
        "links that Sphinx follows",
        "docs/*",
        "league.csv <_static/league.csv>  records.csv <_static/records.csv>",
    ),
    Listed("errors of other packages", "*", "ComputeError  TokenError  LinAlgError"),
    Listed("names of shells", "docs/*", "_pivident  fpath"),
    Listed("values of JSON", "docs/*", "null"),
    Listed("functions of MATLAB and SciPy", "*", "decimate  dlti  filtfilt"),
    Listed(
        "packages that are not installed for tests",
        "*",
        "control.StateSpace  control.TransferFunction  sympy.cse",
    ),
    Listed("levels of BIRDy's protocol", "docs/studies.md", "n5  d4  rv2sq"),
    Listed(
        "names of other packages that are compared with",
        "docs/reference/beside.md",
        """
        llf  std_errors  tstats  coef_  wald_test  get_robustcov_results  first_stage
        sargan  wu_hausman  fit_constrained  fit_regularized  get_prediction  get_params  clone
        sample_weight  missing="drop"
        """,
    ),
    Listed("folder that the benchmarks write", "docs/speed.md", "benchmarks/results/"),
    Listed(
        "columns of logs that are recognised",
        "CHANGELOG.md",
        "poscmd_2  q_d  q_hip  qdes3  qref1  tau_hip",
    ),
    Listed(
        "what was there before, and is said to be gone",
        "CHANGELOG.md",
        'PrefilteredIV(regressor="simulated")  replace(result, theta=…)  position_gains',
    ),
)
