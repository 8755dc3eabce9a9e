"""Version of the package, which results and pages carry."""

__version__ = "0.1.0"
