"""Capabilities: what is known about interfaces and the runners that implement them.

Reading capability files (``load``) imports a YAML parser and pydantic; the built-in library comes
from a compiled table (``table``) and needs neither.
"""
