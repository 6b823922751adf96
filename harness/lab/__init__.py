"""The map lab: one log or recording through maps of other settings, side by side."""
