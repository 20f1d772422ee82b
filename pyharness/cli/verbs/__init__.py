"""The verbs of the command line, a module for each.

Each `run` prints the results and returns the exit status, 0 unless stated otherwise.
"""
