"""Benchmark of odometries: drift and time on the sweeps of episodes, ours beside others."""

from wayproof.harness.bench.odometry.drift import bench_odometry

__all__ = ["bench_odometry"]
