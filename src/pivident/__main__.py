"""``python -m pivident``: the command line."""

import sys

from pivident.app.cli import main

sys.exit(main())
