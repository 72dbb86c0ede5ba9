"""What the studies of the paper share: its robot, its noise, trials, printed numbers, pages."""
