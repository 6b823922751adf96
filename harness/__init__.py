"""Scenario, episode loop, decision, log, replay and command line."""

if __name__ != "wayproof.harness":  # from the root of a clone, where it would be a second copy
    raise ImportError("got 'import harness', expected 'import wayproof.harness'")
