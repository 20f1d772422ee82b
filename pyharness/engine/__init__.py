"""Methods that solve a scene."""
