"""Whatever can be run on a scene, held against each other and against the truth."""
