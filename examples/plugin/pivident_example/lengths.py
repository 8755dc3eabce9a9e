"""The command ``pivident lengths``: does a longer record pay?"""

from pathlib import Path


def lengths(experiment: Path, /, *, parts: int = 4, method: str = "piv") -> int:
    """Report how the standard errors fall with the length of the record.

    Parameters
    ----------
    experiment
        The experiment file.
    parts
        Number of lengths, from a part of each recording to the whole of it.
    method
        The method.
    """
    from dataclasses import replace

    import numpy as np

    import pivident as pv

    problem = pv.load_experiment(experiment).problem()
    for part in range(1, parts + 1):
        recordings = tuple(
            recording.slice(
                recording.start_time, recording.start_time + recording.duration * part / parts
            )
            for recording in problem.recordings
        )
        result = pv.identify(replace(problem, recordings=recordings), method)
        seconds = sum(recording.duration for recording in recordings)
        print(f"{seconds:8.2f} s: median standard error {np.median(result.relative_std):.3g} %")
    return 0
