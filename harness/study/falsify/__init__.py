"""Falsification: the search for a perturbation that makes an episode fail."""
