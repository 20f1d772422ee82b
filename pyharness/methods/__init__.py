"""Methods that solve a scene: choice of a method, list of all methods, and their solvers."""
