"""Processes of tests that are interrupted."""

import signal


def heed_ctrl_c() -> None:
    """In a process that is started: heed SIGINT, which tests in the background inherit ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
