"""The system: what the robot can do."""
