"""All that knows MuJoCo: robots, sensors, worlds."""

if __name__ != "wayproof.models":  # from the root of a clone, where it would be a second copy
    raise ImportError("got 'import models', expected 'import wayproof.models'")
