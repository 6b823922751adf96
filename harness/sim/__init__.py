"""The simulated robot: physics, sensors, pose estimate, perturbation, and what ends an episode."""
