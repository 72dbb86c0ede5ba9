"""The inner work of the library beside the naive form of each, with the same answers."""
