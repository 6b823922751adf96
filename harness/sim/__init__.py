"""The simulated robot: physics, sensors, pose estimate, perturbation, and the end of an episode."""
