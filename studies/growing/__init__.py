"""How time and memory grow: the robots, the runs, and what others need."""
