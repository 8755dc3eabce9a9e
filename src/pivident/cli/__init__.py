"""The command ``pivident``."""

from pivident.cli.app import main as main
