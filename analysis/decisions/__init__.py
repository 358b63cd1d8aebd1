"""The analyses, one module each (semantics, section 5): what is decided about a plan."""
