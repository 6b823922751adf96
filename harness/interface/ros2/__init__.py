"""ROS 2 as a way in for a stack: a DDS participant of its own, without a ROS installation."""
