"""Robot and model against motion: columns, `Information`, base parameters, reductions."""
