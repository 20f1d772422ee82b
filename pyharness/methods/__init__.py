"""Methods that solve a scene: the plan, the registry, and one module for each family."""
