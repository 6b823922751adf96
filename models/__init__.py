"""All that knows MuJoCo: robots, sensors, worlds."""
