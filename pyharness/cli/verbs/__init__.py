"""The verbs of the command line, one module each.

`run` prints the results and returns the exit status: 0, unless its docstring says otherwise.
"""
