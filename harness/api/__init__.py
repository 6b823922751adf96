"""Public Python interface: run an episode, open a log or a study, get tables, arrays and plots."""
