"""In place of ``python -P -m pivident …`` runs ``script.py`` of the project, where there is one.

The clock of a supervisor is ten times as fast where the project has a file ``hurry``.
"""

import os
import sys

begun = sys.orig_argv[1:4]

if begun == ["-P", "-m", "pivident.app.studio.supervisor"] and os.path.exists("hurry"):
    import time

    true_time = time.monotonic
    time.monotonic = lambda: 10.0 * true_time()

if begun == ["-P", "-m", "pivident"] and os.path.exists("script.py"):
    code = 0
    try:
        with open("script.py", encoding="utf-8") as file:
            exec(compile(file.read(), "script.py", "exec"), {"argv": sys.orig_argv[4:]})
    except SystemExit as end:
        code = int(end.code or 0)
    except KeyboardInterrupt:
        code = 130
    sys.stdout.flush()
    os._exit(code)
