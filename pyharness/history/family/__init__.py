"""The weighted residual methods, with derived and measured orders of convergence."""
