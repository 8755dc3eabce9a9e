"""In place of ``python -P -m pivident …`` runs ``script.py`` of the project, where there is one."""

import os
import sys

if sys.orig_argv[1:4] == ["-P", "-m", "pivident"] and os.path.exists("script.py"):
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
