"""Accuracy of the attribution of causes, on failures with one known fault."""
