"""From a config to what is simulated: world, robot, scene, mission."""
