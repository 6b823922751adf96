"""From a failure to a test that stays: the smallest scenario of it, and a folder that runs it."""
