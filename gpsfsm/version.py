"""The version of gpsfsm; the same as in pyproject.toml, which a test compares."""

__all__ = ["VERSION"]

VERSION = "0.1.0"
