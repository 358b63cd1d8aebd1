"""ROS 2: runners that act on a robot, and what stands between plans and the robot's own servers.

rclpy and the packages of messages come from the ROS 2 that is sourced (``source
/opt/ros/<distro>/setup.bash``); nothing here imports them before a node is needed.
"""
