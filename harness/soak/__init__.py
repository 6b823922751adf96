"""Long runs that try to break what a log promises; `python -m wayproof.harness.soak --help`."""
