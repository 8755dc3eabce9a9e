"""An interruption that comes where C has called back into Python ends the command all the same."""

import os
import signal
import subprocess
import sys

import pytest

#: A command that C calls back, qsort in the place of LLVM, and that a signal hits just there.
CODE = """
import ctypes, ctypes.util, os, signal, sys, time
from pivident.app.cli import app as module

kind = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)

@kind
def compare(a, b):
    os.kill(os.getpid(), signal.SIGTERM)
    for _ in range(1000):
        pass
    return 0

def command(*_, **__):
    numbers = (ctypes.c_int * 2)(2, 1)
    ctypes.CDLL(None).qsort(numbers, 2, 4, compare)
    print("goes on", flush=True)
    for _ in range(100):
        time.sleep(0.1)

module.app = command
sys.exit(module.main())
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("at_rest", [signal.SIG_DFL, signal.SIG_IGN], ids=["default", "nohup"])
def test_a_signal_inside_a_callback_of_c_is_not_lost(at_rest):
    """In the background, where SIGINT is ignored, too."""
    done = subprocess.run(
        [sys.executable, "-c", CODE, "identify"],
        capture_output=True,
        text=True,
        timeout=120,
        preexec_fn=lambda: signal.signal(signal.SIGINT, at_rest),
    )
    assert done.stdout == "goes on\n"  # the interruption was dropped where it came
    assert done.returncode == 130
    assert done.stderr == "interrupted; no file is left half written\n"
