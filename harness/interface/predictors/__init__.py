"""Predictors from outside: connecting them, querying them between decisions, serving them."""
