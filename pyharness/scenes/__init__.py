"""Random scenes by kind, and transformations of a scene."""
