"""Predictors from outside: ways in, the questions that they are asked, and their serving."""
