"""What turns a scene into a trajectory: the plan, the registry, one file for each family."""
