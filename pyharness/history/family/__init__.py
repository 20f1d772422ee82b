"""The weighted residual methods as one family: orders derived, and orders measured."""
