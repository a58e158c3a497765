"""Motion capture systems, and poses by UDP and ROS 2; servers of the simulator's poses."""
