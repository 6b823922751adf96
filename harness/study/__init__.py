"""Studies: many episodes, paired, judged."""
