"""Scenarios, built from configs: world, robot, scene, mission."""
