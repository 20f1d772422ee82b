"""The verbs of the command line, one module each.

`run` prints the results and returns the exit status: 0, or 1 where its docstring says so.
"""
