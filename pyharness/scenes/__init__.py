"""Random scenes of several kinds, extreme scenes, and transformations of a scene."""
