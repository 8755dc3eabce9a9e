"""Logs whose gains follow from the masses of the description, as `pivident init` takes them."""

from dataclasses import replace

import numpy as np

from pivident.data.logs.torque_scale import ASSUMED, MASSES, TorqueScale
from pivident.estimation.problem import Problem
from pivident.judgement.audit.description_factors import description_factors
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.recording_audit import log_of
from pivident.judgement.audit.timing import check_timing


def by_masses(problem: Problem) -> Problem:
    """The same with the torque in amperes of such drives, wherever the masses show a gain."""
    (record,) = problem.recordings
    log = log_of(problem.robot, record)
    factors = description_factors(log, build_inverse_model(log, check_timing(log))).factors
    known = np.isfinite(factors)
    usual = np.median(np.abs(factors[known])) if known.any() else 1.0
    scales = tuple(
        TorqueScale(name, "A", MASSES if masses else ASSUMED)
        for name, masses in zip(record.joint_names, known.tolist(), strict=True)
    )
    tau = record.tau / np.where(known, np.abs(factors), usual)
    return replace(problem, recordings=(replace(record, tau=tau, torque_scale=scales),))
