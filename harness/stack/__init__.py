"""The stack under test: from what a decision may see to what it decides."""
