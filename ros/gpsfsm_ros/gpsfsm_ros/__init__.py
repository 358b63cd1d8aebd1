"""gpsfsm as a package of ROS 2: console scripts and launch files around its command line."""
