"""What users ask for, one folder or file a verb; none imports one above it."""
