"""One comparison per module."""
