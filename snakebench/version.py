"""The version, also of the distribution."""

__version__ = "2.0.0"
