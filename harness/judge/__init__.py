"""Does this body fit here? The judge's answer, by the map as logged, in simple code."""
