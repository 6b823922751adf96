"""What `wayproof bench` measures: a stage is a file, and one line of `stages.STAGES`."""
