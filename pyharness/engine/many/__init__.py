"""Solutions of many scenes at once."""
