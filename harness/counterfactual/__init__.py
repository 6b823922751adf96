"""Counterfactual check of a cause: one thing put right, and the rest simulated again."""
