"""Interruptions by Ctrl-C and by SIGTERM, wherever they come.

Either raises KeyboardInterrupt in the main thread. Where C has called back into Python, as LLVM
does whenever compiled kernels are loaded, an exception cannot go on to the caller: Python reports
it and drops it, and the command would run on. Such an interruption comes again a moment later.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from typing import Any

#: After what time an interruption comes again [s].
AGAIN = 0.02


def end_on_signals(alone: bool) -> None:
    """Let SIGTERM interrupt as Ctrl-C does; none of both is lost in a process that is ``alone``.

    ``alone``: the process is this command's, and no notebook or test.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if not alone:
        return
    report = sys.unraisablehook

    def dropped(found: Any) -> None:
        if issubclass(found.exc_type, KeyboardInterrupt):
            # SIGTERM, since in the background SIGINT may be ignored
            again = threading.Timer(AGAIN, _thread.interrupt_main, [signal.SIGTERM])
            again.daemon = True
            again.start()
        else:
            report(found)

    sys.unraisablehook = dropped
