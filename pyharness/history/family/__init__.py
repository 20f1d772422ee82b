"""The weighted residual methods as one family, with derived and measured orders of convergence."""
