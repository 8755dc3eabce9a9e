"""What a page's reader has before the page begins: a log, an experiment file, results.

Each function fills the current folder; a page calls it by a ``before`` mark. What it returns are
names that the page's Python blocks have.
"""

import os
from importlib.resources import files
from pathlib import Path

import numpy as np

from tests import planar_log as planar
from tests.synthetic_identification import synthetic_identification


def planar_log() -> dict:
    """`log.csv` of the planar arm, `my_robot.toml` that describes it, and its problem."""
    import pivident as pv

    rows = planar.planar_log(samples=2500)
    np.savetxt("log.csv", rows, fmt="%.9g", delimiter=",", header=planar.HEADER, comments="")
    Path("my_robot.toml").write_text(planar.EXPERIMENT, encoding="utf-8")
    problem = pv.load_experiment("my_robot.toml").problem()
    return {"pv": pv, "problem": problem, "recording": problem.recordings[0]}


def positions_log() -> None:
    """`positions.csv` of the planar arm: time, positions and references, no torque."""
    rows = planar.planar_log(samples=2500)[:, :5]
    names = planar.HEADER.rpartition(",tau1")[0]
    np.savetxt("positions.csv", rows, fmt="%.9g", delimiter=",", header=names, comments="")


def another_motion() -> None:
    """`my_robot-results` of two methods, and `new_log.csv` of another motion."""
    from pivident.app.cli import main

    planar_log()
    assert main(["identify", "my_robot.toml", "-m", "ls,piv"]) == 0
    rows = planar.planar_log(samples=3000, seed=11)
    np.savetxt("new_log.csv", rows, fmt="%.9g", delimiter=",", header=planar.HEADER, comments="")


def synthetic_results() -> None:
    """`my_robot-results`: an estimate of the planar arm, without a record."""
    synthetic_identification(relative_std=0.02).save("my_robot-results")


def results_of_two_days() -> None:
    """`monday` and, with more friction, `friday`; `my_robot-results` of two methods."""
    from pivident.app.cli import main
    from tests.studies.comparison.results import result

    result(1).save("monday/piv")
    result(3, fv1=1.25).save("friday/piv")
    result(1).save("my_robot-results/piv")
    result(2, "IDIM-WLS", record=1).save("my_robot-results/ls")
    assert main(["consistent", "monday/piv"]) == 0


def first_logs() -> None:
    """A URDF as `arm.urdf` and `my_arm.urdf`, and a log whole, in two files, and as two runs."""
    planar_robot_files()
    for name in ("arm.urdf", "my_arm.urdf"):
        Path(name).write_bytes(Path("my_robot.urdf").read_bytes())
    rows, names = planar.planar_log(samples=2500), planar.HEADER.split(",")
    for name, columns in {
        "log": range(7),
        "position": range(5),
        "effort": (0, 5, 6),
        "run1": range(7),
        "run2": range(7),
    }.items():
        chosen = list(columns)
        header = ",".join(names[k] for k in chosen)
        np.savetxt(
            f"{name}.csv", rows[:, chosen], fmt="%.9g", delimiter=",", header=header, comments=""
        )


def log_without_header() -> None:
    """`bare.txt`, the log of the planar arm in radians without a header."""
    rows = planar.planar_log(samples=2500).copy()
    rows[:, 1:5] = np.deg2rad(rows[:, 1:5])
    np.savetxt("bare.txt", rows, fmt="%.9g")


def seven_axis_log() -> None:
    """`log.csv` of a seven-axis arm with torque sensors behind its gears, and `arm.urdf`."""
    from tests.seven_axis_arm import seven_axis_log as made, write_log

    log = made(3, seconds=6.0, bearings=0.1)
    write_log(Path(), log, log.tau_link)


def planar_bag() -> dict:
    """`run_3`, a ROS 2 bag of the planar arm, and its robot."""
    import pivident as pv
    from tests import bags

    rows = planar.planar_log(samples=2500)[::4]
    store = bags.typestore("sqlite3")
    states = bags.joint_states(
        store, False, ["shoulder", "elbow"], rows[:, 0], np.deg2rad(rows[:, 1:3]), rows[:, 5:7]
    )
    os.replace(bags.write_bag(Path(), "sqlite3", store, [states]), "run_3")
    return {"pv": pv, "robot": pv.load_robot("planar_2r")}


def ampere_logs() -> dict:
    """Logs in amperes without and with a payload, `my_robot.toml` with both."""
    import pivident as pv
    from pivident.experiment.gains_table import with_unit_gains
    from tests.app.cli.test_gains import HEAD, LOADED, write_log as write_amperes

    write_amperes(Path("empty.csv"), loaded=False)
    write_amperes(Path("loaded.csv"), loaded=True)
    Path("my_robot.toml").write_text(HEAD + LOADED, encoding="utf-8")
    Path("loaded.toml").write_text(HEAD.replace("empty", "loaded"), encoding="utf-8")
    empty, loaded = (
        with_unit_gains(pv.load_experiment(name)) for name in ("my_robot.toml", "loaded.toml")
    )
    return {"problem": empty.problem(), "loaded": loaded.recordings()[0]}


def force_sensor_log() -> dict:
    """`log.csv` of a TX40 on a force sensor, simulated by MuJoCo; currents beside its torques."""
    from benchmarks.base_wrench import DRIVE_GAINS, arm_on_sensor, arm_record

    import pivident as pv

    recording = arm_record(arm_on_sensor(), 1, 5.0)
    q, q_ref, tau = (x[:, 6:] for x in (recording.q, recording.q_ref, recording.tau))
    channels = [np.rad2deg(q), np.rad2deg(q_ref), tau, tau / DRIVE_GAINS]
    rows = np.column_stack([recording.t, *channels, recording.wrenches[0].values])
    names = [f"{stem}{k}" for stem in ("q", "r", "tau", "i") for k in range(1, 7)]
    header = ",".join(["time", *names, "fx", "fy", "fz", "mx", "my", "mz"])
    np.savetxt("log.csv", rows, fmt="%.9g", delimiter=",", header=header, comments="")
    return {"pv": pv}


def payload_logs() -> None:
    """The same for a payload: `my_robot.toml`, `loaded.toml`, and the arm alone in `results`."""
    from pivident.app.cli import main
    from tests.app.cli.test_payload import BOTH, HEAD, RECORD

    ampere_logs()
    Path("my_robot.toml").write_text(BOTH, encoding="utf-8")
    for name in ("empty", "loaded"):
        Path(f"{name}.toml").write_text(HEAD.format(RECORD.format(name)), encoding="utf-8")
    assert main(["identify", "empty.toml", "-m", "ls", "--folds", "0", "--out", "results"]) == 0


def suspended_leg() -> None:
    """`log.csv` of a leg that MuJoCo simulated, its `leg.xml` without friction, and `leg.toml`."""
    from tests.studies.simulators.leg import write_leg

    write_leg(Path())


def flexible_log() -> None:
    """The log of an axis with both encoders, and `my_robot.toml`."""
    from tests.app.cli.test_flexibility import write

    os.replace(write(Path()), "my_robot.toml")


def planar_fleet() -> None:
    """`logs` of two planar arms over some days with `logs/fleet.toml`, which is `arm.toml` too."""
    from tests.studies.many.fleet.planar_fleet import TEMPLATE, write_fleet

    write_fleet(Path("logs"), robots=2, days=3)
    Path("arm.toml").write_text(TEMPLATE, encoding="utf-8")


def planar_robot_files() -> None:
    """A robot as `my_robot.urdf` and as `my_robot.toml`."""
    from pivident.models.export.urdf import to_urdf
    from pivident.models.runnable_model import runnable_model
    from pivident.robot.gallery import load_robot

    Path("my_robot.urdf").write_bytes(to_urdf(runnable_model(load_robot("planar_2r"))).content)
    shipped = files("pivident.robot") / "gallery" / "planar_2r.toml"
    Path("my_robot.toml").write_bytes(shipped.read_bytes())


def small_scenario() -> None:
    """`my_scenario.toml`: a study of short records of the planar arm."""
    from tests.studies.many.study.small import TEXT

    Path("my_scenario.toml").write_text(TEXT, encoding="utf-8")


def rippled_log() -> dict:
    """A log of the planar arm whose shoulder has a cogging torque, and its problem."""
    from dataclasses import replace

    names = planar_log()
    recording = names["recording"]
    tau = recording.tau.copy()
    tau[:, 0] += 0.5 * np.sin(20 * recording.q[:, 0])
    recording = replace(recording, tau=tau)
    return names | {
        "recording": recording,
        "problem": replace(names["problem"], recordings=(recording,)),
    }
