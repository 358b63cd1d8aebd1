"""The fixers by what they mend; each module lists its own as ``FIXERS``."""
