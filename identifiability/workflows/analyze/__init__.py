"""The main job: one verdict a parameter, and the model to use."""
