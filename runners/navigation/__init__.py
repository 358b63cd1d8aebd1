"""Navigation: driving, knowing where the robot is, and the map."""
