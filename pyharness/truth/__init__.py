"""The solution of a scene, with its error."""
