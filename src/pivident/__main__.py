"""``python -m pivident``: the command line."""

import sys

from pivident.cli import main

sys.exit(main())
