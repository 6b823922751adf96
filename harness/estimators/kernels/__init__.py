"""Kernels of lidar odometry."""
