"""The verbs of the command line, one module each.

Each `run` prints the results and returns the exit status, 0 unless stated otherwise.
"""
