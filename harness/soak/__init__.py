"""Long runs that try to break what a log promises; `python -m harness.soak --help`."""
