"""Outputs of some seventy commands, recorded and compared, which a refactoring must not change."""
