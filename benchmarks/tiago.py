"""TIAGo: from three CSV files and a URDF of 58 joints to the torques of motion that was not fitted.

    PIVIDENT_DATA=FOLDER python benchmarks/tiago.py

The experiment file is that of `pivident init`. Its window is then cut to the first 70 % of the rows
921 to 6791; the last 30 % are held out. Errors: rms(τ - Φθ)/rms(τ) by joint, of the effort as it
was logged, with its noise, and below the band of the motion. What noise the effort has beyond that
band says how far below an error of all frequencies could be. In logged units, over arm_1 to arm_4:
‖e‖/‖τ‖. The gains of the draft, one number for each joint, come from the whole motion, its
held-out part included; parameters come from the first 70 % alone.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident import load_experiment
from pivident.data.logs.tables.read_csv import read_csv
from pivident.data.recording.datasets import ENVIRONMENT
from pivident.estimation.identify import identify
from pivident.experiment.init.draft import Draft, draft_experiment
from pivident.judgement.validation.held_out.prediction import Judge, PredictionError

#: Rows of the useful window, and the share of them that is fitted.
ROWS, FITTED = (921, 6791), 0.7

#: The joints that are judged.
JUDGED = ("arm_1_joint", "arm_2_joint", "arm_3_joint", "arm_4_joint")


@dataclass(frozen=True, eq=False)
class Outcome:
    """Errors on the held-out motion.

    Attributes:
        draft: what `pivident init` wrote.
        error: by joint, in N m as the draft has them.
        gains: N m or N per unit of the logged effort, by joint.
    """

    draft: Draft
    error: PredictionError
    gains: np.ndarray

    @property
    def judged(self) -> list[int]:
        """Indices of arm_1 to arm_4."""
        return [self.error.joint_names.index(name) for name in JUDGED]

    def in_logged_units(self, band: bool = False) -> float:
        """‖e‖/‖τ‖ over the judged joints, in logged units [%]."""
        rms = self.error.rms_in_band if band else self.error.rms
        size = self.error.torque_in_band if band else self.error.torque
        scale = 1.0 / np.abs(self.gains[self.judged])
        ratio = np.linalg.norm(rms[self.judged] * scale) / np.linalg.norm(size[self.judged] * scale)
        return 100.0 * float(ratio)


def run(data: Path, folder: Path, joints: tuple[str, ...] = ()) -> Outcome:
    """Draft the experiment, fit 70 % of the window, predict the rest.

    Args:
        data: folder with the record.
        folder: where the experiment file goes.
        joints: joints to identify; those that `pivident init` takes otherwise.
    """
    logs = [data / f"tiago_{kind}.csv.gz" for kind in ("position", "velocity", "effort")]
    out = folder / "experiment.toml"
    draft = draft_experiment(logs, str(data / "tiago_48_hey5.urdf.gz"), out=out, joints=joints)
    out.write_text(draft.text, encoding="utf-8")
    experiment = load_experiment(out)
    (entry,) = experiment.content.recording
    t = read_csv(logs[0], ["t"])["t"]
    begin, end = (float(t[row]) for row in ROWS)
    split = begin + FITTED * (end - begin)
    parts = []
    for part in ([begin, split], [split, end]):
        cut = entry.model_copy(update={"part": part})
        content = experiment.content.model_copy(update={"recording": [cut]})
        parts.append(type(experiment)(out, content))
    problem = parts[0].problem()
    found = identify(problem, parts[0].methods()["ls"])
    (unseen,) = parts[1].recordings()
    (error,) = Judge(unseen).score(found, [slice(0, unseen.samples)])
    gains = np.array([unit["gain"] for unit in entry.units.tau])
    return Outcome(draft, error, gains)


def main() -> None:
    """Print the errors."""
    import os

    data = Path(os.environ[ENVIRONMENT]) / "tiago"
    for joints in ((), JUDGED):
        with tempfile.TemporaryDirectory() as folder:
            outcome = run(data, Path(folder), joints)
        error = outcome.error
        print(f"{len(error.joint_names)} joints: {', '.join(error.joint_names)}")
        print(f"{'joint':<18}{'error %':>9}{f'< {error.band:.4g} Hz':>12}{'noise < band %':>16}")
        noise = 100.0 * error.noise_in_band / error.torque_in_band
        for j, name in enumerate(error.joint_names):
            row = (error.relative[j], error.relative_in_band[j], noise[j])
            print(f"{name:<18}{row[0]:>9.1f}{row[1]:>12.1f}{row[2]:>16.1f}")
        total, band = outcome.in_logged_units(), outcome.in_logged_units(band=True)
        print(f"arm_1 to arm_4 in logged units: {total:.1f} %, in the band {band:.1f} %\n")


if __name__ == "__main__":
    main()
