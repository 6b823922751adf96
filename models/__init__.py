"""Robots, sensors and worlds: everything that uses MuJoCo."""

if __name__ != "wayproof.models":  # from the root of a clone, where it would be a second copy
    raise ImportError("got 'import models', expected 'import wayproof.models'")
