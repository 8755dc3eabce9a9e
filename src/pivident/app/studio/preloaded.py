"""What the process has imported and called that tasks are forked from, once for all of them.

A first audit loads compiled kernels from their caches, a first page the figure library: together
several seconds, which every look would take anew.
"""

from __future__ import annotations

import numpy as np

import pivident.app.studio.drafting
import pivident.app.studio.looks  # noqa: F401
from pivident.data.logs.log import Log
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor_kernels import observe
from pivident.estimation.methods import METHODS
from pivident.foundation.compiled import is_compiled
from pivident.foundation.extras import is_installed
from pivident.judgement.audit.audit import audit_log
from pivident.robot.gallery import load_robot

#: Rate [Hz] and samples of the log that is audited, enough for every check.
RATE, SAMPLES = 200.0, 1000


def warm_up() -> None:
    """Audit a log of two joints that swing, and draw its page."""
    METHODS.usable()  # each is offered with its time
    robot = load_robot("planar_2r")
    base_parameters(robot)
    t = np.arange(SAMPLES) / RATE
    q = np.column_stack([np.sin(3.0 * t) + 0.3 * np.sin(7.1 * t), np.cos(4.3 * t)])
    channels = {"q": q, "tau": 20.0 * np.cos(q) + 5.0 * np.sign(np.gradient(q, axis=0)) - q}
    log = Log("log", robot.joint_names, {}, {"t": t}, None, channels, channels, robot)
    audit = audit_log(log)
    if is_installed("plotly"):
        from pivident.judgement.report.audit_account import render_page

        render_page((audit,))


if is_compiled(observe):  # compiling would keep the first signals waiting
    warm_up()
