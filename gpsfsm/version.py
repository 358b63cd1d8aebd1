"""The version of gpsfsm; the same as in pyproject.toml, which a test compares."""

VERSION = "0.1.0"
