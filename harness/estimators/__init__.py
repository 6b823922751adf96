"""Estimators of the body's pose from what its sensors measure."""
