"""`make cross-check`: other compilers, other flags, and a build with every run-time check."""
