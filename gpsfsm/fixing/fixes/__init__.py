"""The fixers, one per module; ``FIXER`` is what the registry finds."""
