"""Error bounds and stability limits, derived without running a program."""
