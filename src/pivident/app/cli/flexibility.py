"""The command ``pivident flexibility``: stiffness of joints, and what it does to a rigid model."""

from __future__ import annotations

from pathlib import Path

from pivident.app.cli.console import Progress
from pivident.foundation.errors import ExperimentError


def flexibility(
    experiment: Path, /, *, bandwidth: float | None = None, out: Path | None = None
) -> int:
    """Report how flexible the joints of a log are, and whether a rigid model of them is valid.

    Both encoders (columns q and q_link) give stiffness, hysteresis and transmission error; the
    motor's encoder and the reference give the resonance, if the reference excites it.

    Parameters
    ----------
    experiment
        The experiment file.
    bandwidth
        Bandwidth of the control loop in Hz, where it is known.
    out
        Folder for flexibility.json and flexibility.html. Default: NAME-flexibility for NAME.toml.
    """
    from pivident.experiment.experiment import load_experiment
    from pivident.foundation.files import check_output
    from pivident.studies.flexibility.account import (
        agreement_lines,
        flexibility_lines,
        write_study,
    )
    from pivident.studies.flexibility.joint_study import study_flexibility

    if bandwidth is not None and not bandwidth > 0:
        raise ExperimentError(
            f"--bandwidth {bandwidth:g} is not a frequency", advice="give it in Hz"
        )
    folder = out or Path(f"{experiment.stem}-flexibility")
    check_output(folder)
    with Progress() as progress:
        progress.say("reading the recordings")
        read = load_experiment(experiment)
        recordings = read.recordings()
        progress.say("looking for flexibility")
        found = study_flexibility(read.robot, recordings, bandwidth)
        progress.say("writing the page")
        page = write_study(found, folder)
    for one in found:
        print("\n".join(flexibility_lines(one)), end="\n\n")
    print("\n".join([*agreement_lines(found), f"\nPage: {page}"]))
    return 0
