"""The verbs of the command line, one module each.

The function `run` of each prints the results and returns the exit status: 0, unless its docstring
says otherwise.
"""
