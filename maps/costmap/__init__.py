"""The costmap: a map projected for one body, distances to its obstacles, and costs."""
