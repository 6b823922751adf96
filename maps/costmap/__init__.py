"""The costmap: what of a map a body meets, how far it is from it, and at what cost."""
