"""Estimators of the body's pose from its sensors' measurements."""
