"""What runners hand to each other: values, and prompts in buffers (semantics, 8.2 and 8.3)."""
