"""Other representations behind the same interface, and what they share."""
