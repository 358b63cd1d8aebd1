"""The built-in providers: one module each, which defines ``PROVIDER``; ``_`` marks helpers."""
