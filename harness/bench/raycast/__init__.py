"""Rays that share no origin, to compare the tile caster with, and scenes to cast them in."""
