"""Public logs, robot files and bug reports from bare files: what becomes of each.

    PIVIDENT_DATA=FOLDER python benchmarks/public_cases.py [CASE …]

FOLDER/public holds a folder for each case, with a README that says what is right; the records
beside it are cases too. Nothing but the files is given: a description and a log go through
`pivident init --yes`, `identify` and `compare`, which reads back what was written. Each row is one
command or chain of commands: seconds of processor time, exit codes, what was reached (held-out
torque error of LS, IV and PIV, or the sentence of a refusal), and the right answer.
"""

from __future__ import annotations

import gzip
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

#: Longest time of one command [s].
PATIENCE = 600

#: Exit codes that are an answer: done, a method did not converge, something is to be decided.
ANSWERS = (0, 3, 4)

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

METHODS = {"ls": "LS", "iv-full-rate": "IV", "piv": "PIV"}

#: Held-out errors by which the estimate that is taken is judged: its own, and that of an own least
#: squares with viscous and Coulomb friction on the same rows, in the same band.
TAKEN = ("error", "plain law")

#: How much larger the first may be than the second.
AS_PLAIN = 1.03


@dataclass(frozen=True)
class Run:
    """What a chain of commands has come to."""

    folder: Path
    codes: tuple[int, ...]
    seconds: float
    said: str  # all output

    @property
    def last_line(self) -> str:
        """The last line that says something."""
        lines = [line for line in self.said.splitlines() if line.strip()]
        return lines[-1] if lines else ""


@dataclass(frozen=True)
class Case:
    """One question."""

    name: str
    folder: str
    commands: tuple[str, ...]  # {here}: folder of the case, unpacked
    right: str
    reached: Callable[[Run], str]
    must_end: Callable[[Run], bool] = field(default=lambda run: True)  # as it has to


def held_out(run: Run) -> str:
    """Held-out errors of the three methods, and whether the result is read back."""
    path = run.folder / "experiment-results" / "verdict.json"
    if not path.is_file():
        return run.last_line
    verdict = json.loads(path.read_text(encoding="utf-8"))
    errors = verdict["held_out"]
    listed = [
        f"{label} {errors[name]['total']:.3g} %" if name in errors else f"{label} –"
        for name, label in METHODS.items()
    ]
    evidence = verdict["uses"]["torque"]["evidence"]
    taken = [f"{name} {evidence[name]['value']:.3g} %" for name in TAKEN if name in evidence]
    return f"{', '.join(listed + taken)}; {verdict['headline'].partition(':')[0].rstrip('.')}"


def three_methods(run: Run) -> bool:
    """Whether all three methods were written and read back."""
    results = run.folder / "experiment-results"
    written = all((results / name / "identification.json").is_file() for name in METHODS)
    return written and len(run.codes) > 2 and all(code in ANSWERS for code in run.codes)


def as_plain(run: Run) -> bool:
    """Whether all methods were written, and the one to take predicts as well as the plain law."""
    path = run.folder / "experiment-results" / "verdict.json"
    if not (path.is_file() and all(code in ANSWERS for code in run.codes)):
        return False
    evidence = json.loads(path.read_text(encoding="utf-8"))["uses"]["torque"]["evidence"]
    own, plain = (evidence[name]["value"] for name in TAKEN)
    return all((path.parent / name).is_dir() for name in METHODS) and own <= AS_PLAIN * plain


def last_line(run: Run) -> str:
    """The last sentence."""
    return run.last_line


def refused_with(*words: str) -> Callable[[Run], bool]:
    """Whether a refusal names some words, and is no crash."""
    return lambda run: (
        run.codes[-1] not in (0,)
        and "Traceback" not in run.said
        and "bug" not in run.last_line
        and all(word in run.said for word in words)
    )


def lines_with(*words: str) -> Callable[[Run], str]:
    """The lines of the output that hold one of some words."""

    def found(run: Run) -> str:
        lines = [line.strip() for line in run.said.splitlines() if any(w in line for w in words)]
        return " / ".join(dict.fromkeys(lines)) or run.last_line

    return found


def ends_well(run: Run) -> bool:
    """Whether every command ended with an answer."""
    return all(code in ANSWERS for code in run.codes)


def identification(log: str, robot: str) -> tuple[str, ...]:
    """From bare files to a result that is read back."""
    return (
        f"init {log} --robot {robot} --yes",
        "identify experiment.toml",
        "compare experiment-results/ls experiment-results/piv",
    )


def by_example(folder: str) -> tuple[str, ...]:
    """The experiment of an example, with the three methods."""
    methods = " ".join(f"-m {name}" for name in METHODS)
    return (f"identify {{examples}}/{folder}/experiment.toml {methods} --out experiment-results",)


#: Logs of other arms, for cases that are a robot's file alone.
SIX_AXES = "{here}/../q02_effort_without_gravity/log_with_gravity.csv"
SEVEN_AXES = "{here}/../r11_panda_30hz_bag/panda_exciting_trajectory.db3"

#: What fits a first-order model with feed-through to the columns t, u, y of a file.
SRIVC = """
import sys, numpy
from pivident.linear import srivc
t, u, y = numpy.loadtxt(sys.argv[1], delimiter=",", skiprows=1).T
print(srivc(u, y, t[1] - t[0], 1, 1))
"""

CASES = (
    Case("q02", "q02_effort_without_gravity", identification("{here}/log.csv", "{here}/ur5e.urdf"),
         "torques hold no gravity: say so", held_out, three_methods),
    Case("q02 with gravity", "q02_effort_without_gravity",
         identification("{here}/log_with_gravity.csv", "{here}/ur5e.urdf"),
         "fitted at noise level", held_out, three_methods),
    Case("q03 CSV", "q03_zeros_two_publishers",
         identification("{here}/zeros.csv", "{here}/ur5e.urdf"),
         "nine rows of zeros named and left out, result as q02 with gravity", held_out,
         three_methods),
    Case("q03 bag", "q03_zeros_two_publishers", identification("{here}/bag", "{here}/ur5e.urdf"),
         "the publisher of zeros left out, result as q02 with gravity", held_out, three_methods),
    Case("q04", "q04_rtde_lost_packages", identification("{here}/rtde.csv", "{here}/ur5e.urdf"),
         "gaps and repeats listed; LS near 0.5 % of the torque", held_out, three_methods),
    Case("q05", "q05_mujoco_zero_start",
         ("init {here}/log.csv --robot {here}/start_model.xml --yes",
          "fit-simulator experiment.toml"),
         "damping 0.35, 0.12; frictionloss 0.6, 0.25; armature 0.045, 0.012",
         lines_with("damping", "frictionloss", "armature", "error:"), ends_well),
    Case("q06", "q06_lugre_joint", identification("{here}/log.csv", "{here}/joint.urdf"),
         "gravity 2.0 within 2 %; 13 to 22 % of the torque unexplained", held_out, three_methods),
    Case("q07", "q07_rc_lead_lag", ("python {here}/ts_1e-07.csv",),
         "pole 1e6 rad/s, feed-through 0.001", lines_with("a1 ", "b0 ", "warning"), ends_well),
    Case("q07 slow", "q07_rc_lead_lag", ("python {here}/ts_5e-06.csv",),
         "a warning that the period is long against the time constant",
         lines_with("a1 ", "b0 ", "warning"), lambda run: "Nyquist" in run.said),
    Case("q08", "q08_payload_puma560",
         ("init {here}/unloaded_1.csv --robot {here}/puma560.urdf --yes --out empty.toml",
          "identify empty.toml", "init {here}/loaded.csv --robot {here}/puma560.urdf --yes "
          "--out loaded.toml", *(f"payload empty-results/{method}/identification.json loaded.toml "
          f"--method {method} --out {method}" for method in METHODS)),
         "2.5 kg at (0.01, -0.02, 0.10) m", lines_with("mass ", "centre", "error:"), ends_well),
    Case("q09 link", "q09_link_side", identification("{here}/link_side.csv", "{here}/ur5e.urdf"),
         "torques behind the gears, no friction of theirs", held_out, three_methods),
    Case("q09 motor", "q09_link_side", identification("{here}/motor_side.csv", "{here}/ur5e.urdf"),
         "torques of the motors", held_out, three_methods),
    Case("r04", "r04_ur10_bag",
         identification("{here}/ur10_exciting_trajectory.db3", "{here}/ur10.urdf"),
         "5 % fitted, 7 % held out", held_out, as_plain),
    Case("r04 validation", "r04_ur10_bag",
         (*identification("{here}/ur10_exciting_trajectory.db3", "{here}/ur10.urdf"),
          "predict experiment-results {here}/ur10_validation_trajectory.db3"),
         "read, or JointTrajectory named as unsupported", last_line,
         lambda run: "Traceback" not in run.said),
    Case("r11", "r11_panda_30hz_bag",
         identification("{here}/panda_exciting_trajectory.db3", "{here}/panda.urdf"),
         "2 % held out", held_out, as_plain),
    Case("r13", "r13_g1_lerobot",
         ("init {here}/data/chunk-000/*.parquet --robot {here}/g1_29dof_rev_1_0.urdf --yes",),
         "no torque: refused, with the list columns named", last_line,
         refused_with("observation.state", "action")),
    Case("d10 panda", "d10_no_inertials",
         identification(SEVEN_AXES, "{here}/panda_compas.urdf"),
         "identified without masses", held_out, three_methods),
    Case("d10 tx2", "d10_no_inertials", identification(SIX_AXES, "{here}/tx2_60l.urdf"),
         "identified without masses (the log is of another arm)", held_out, three_methods),
    Case("d01", "d01_irb4600",
         (f"init {SIX_AXES} --robot {{here}}/irb4600.urdf --yes", "check experiment.toml"),
         "links 1 to 4 named with their impossible inertias (the log is of another arm)",
         lines_with("principal moments", "no body", "No body"), lambda run: "link_1" in run.said),
    Case("d02", "d02_rxl_c3",
         (f"init {SEVEN_AXES} --robot {{here}}/rxl_c3.urdf --yes", "check experiment.toml"),
         "the inertia of Link1 named (the log is of another arm)", lines_with("Link1"),
         lambda run: "Link1" in run.said),
    Case("d03", "d03_rm75", ("excite {here}/rm75.urdf --seconds 5 --rate 250",),
         "limits of zero are unknown, and asked for", last_line,
         refused_with("no speed limits are known of joint_1")),
    Case("d03 hand", "d03_rm75",
         (f"init {SEVEN_AXES} --robot {{here}}/rm75_inspire.urdf --yes", "check experiment.toml"),
         "seven of thirteen degrees of freedom are in the log", lines_with("robot.joints"),
         ends_well),
    Case("TX40", "staubli_tx40",
         identification("{here}/pos_read_data.csv {here}/curr_data.csv",
                        "{here}/tx40_mdh_modified.urdf"),
         "as the README's fits", held_out, three_methods),
    Case("EMPS", "emps", identification("{here}/DATA_EMPS.mat", "emps"), "mass 95.1 kg", held_out,
         three_methods),
    Case("KR300", "kuka_kr300",
         identification("{here}/kr300_traj_A.npz {here}/kr300_traj_B.npz",
                        "{examples}/kuka_kr300/kuka_kr300.toml"),
         "arrays of (axes, samples); 3 to 26 % of each joint", held_out, three_methods),
    Case("TIAGo", "tiago",
         identification("{here}/tiago_position.csv {here}/tiago_velocity.csv "
                        "{here}/tiago_effort.csv", "{here}/tiago_48_hey5.urdf"),
         "arm_1 to arm_4; the other efforts are zero", held_out, as_plain),
    Case("example TX40", "staubli_tx40", by_example("staubli_tx40"),
         "no worse than the plain law", held_out, as_plain),
    Case("example EMPS", "emps", by_example("emps"), "no worse than the plain law", held_out,
         as_plain),
    Case("example KR300", "kuka_kr300", by_example("kuka_kr300"), "no worse than the plain law",
         held_out, as_plain),
)  # fmt: skip


def unpacked(source: Path, target: Path) -> Path:
    """A copy of a case whose gzipped tables are plain ones."""
    if target.is_dir():
        return target
    for path in sorted(source.rglob("*")):
        if not path.is_file():
            continue
        made = target / path.relative_to(source)
        made.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".gz":
            made.with_suffix("").write_bytes(gzip.decompress(path.read_bytes()))
        else:
            shutil.copyfile(path, made)
    return target


def run_case(case: Case, public: Path, folder: Path) -> Run:
    """Carry out the commands of a case, up to the first that ends without an answer."""
    for other in dict.fromkeys((case.folder.split("_")[0], "q02", "r11")):
        for source in (*public.glob(f"{other}_*"), public.parent / case.folder):
            if source.is_dir():
                unpacked(source, folder / source.name)
    work = folder / "work" / case.name.replace(" ", "-")
    work.mkdir(parents=True)
    here, codes, said = folder / case.folder, [], []
    before = os.times()
    for command in case.commands:
        words = []
        for word in command.format(here=here, examples=EXAMPLES).split():
            words += sorted(map(str, Path("/").glob(word[1:]))) if "*" in word else [word]
        program = ["-c", SRIVC, *words[1:]] if words[0] == "python" else ["-m", "pivident", *words]
        done = subprocess.run(
            [sys.executable, *program],
            cwd=work, capture_output=True, text=True, check=False, timeout=PATIENCE,
        )  # fmt: skip
        codes.append(done.returncode)
        said += [done.stdout, done.stderr]
        if done.returncode not in ANSWERS:
            break
    after = os.times()
    seconds = after.children_user + after.children_system
    seconds -= before.children_user + before.children_system
    return Run(work, tuple(codes), seconds, "\n".join(said))


def main(names: list[str]) -> int:
    """Print the table; how many cases do not end as they have to."""
    public = Path(os.environ["PIVIDENT_DATA"]) / "public"
    chosen = [c for c in CASES if not names or any(c.name.startswith(name) for name in names)]
    wrong = 0
    print("| case | commands | s | exit codes | as it has to | reached | right |")
    print("|---|---|---:|---|---|---|---|")
    with tempfile.TemporaryDirectory() as made:
        for case in chosen:
            run = run_case(case, public, Path(made))
            ends = case.must_end(run)
            wrong += not ends
            verbs = ", ".join(command.split()[0] for command in case.commands)
            reached = case.reached(run).replace("|", "/")
            codes = " ".join(map(str, run.codes))
            print(
                f"| {case.name} | {verbs} | {run.seconds:.1f} | {codes} | "
                f"{'yes' if ends else '**no**'} | {reached[:300]} | {case.right} |",
                flush=True,
            )
    print(f"\n{wrong} of {len(chosen)} cases do not end as they have to")
    return wrong


if __name__ == "__main__":
    sys.exit(min(main(sys.argv[1:]), 1))
