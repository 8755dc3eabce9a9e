"""The command ``pivident``."""

from pivident.app.cli.app import main as main
