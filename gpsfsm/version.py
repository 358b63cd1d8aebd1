"""The version, and where gpsfsm is kept: the only place that says either.

What can import this module does. In files that cannot, such as pyproject.toml and the pages of
docs/, ``packaging/stamp.py`` writes what stands here.
"""

VERSION = "0.2.0"

OWNER = "OWNER"
"""The account that publishes gpsfsm; not decided yet, so nothing can be released."""

REPOSITORY = f"https://github.com/{OWNER}/gpsfsm"
IMAGE = f"ghcr.io/{OWNER.lower()}/gpsfsm"  # names of images have no capitals
