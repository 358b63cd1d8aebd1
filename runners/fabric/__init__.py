"""The fabric: plans that follow this one."""
