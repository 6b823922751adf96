"""The stack under test: from the inputs of a decision to the decision."""
