"""The worst that one perturbation can do to an episode: found, kept and cut down to its trigger."""
