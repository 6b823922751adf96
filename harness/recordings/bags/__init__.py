"""ROS bags: containers of ROS 1 and ROS 2, their messages, and the frames between them.

The containers are parsed here, record by record and in the order of the file, so that no length in
a file allocates more than the file holds, and a bag that was cut off is read up to there. The
messages are decoded by `rosbags`, by its own definitions: those in a bag are never compiled.
"""
