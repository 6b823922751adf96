"""Shadow mode: the stack decides on a recording, and the way really driven is judged."""
