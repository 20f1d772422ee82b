"""The verbs of the command line, one module each.

Each function `run` prints the results and returns the exit status: 0, unless its docstring says
otherwise.
"""
