"""Range sensors: devices, their beam patterns and errors, and the casting of their sweeps."""
