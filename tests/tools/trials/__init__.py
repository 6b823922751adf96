"""Robots under trial: random commands, terrain, wind and estimates with errors."""
