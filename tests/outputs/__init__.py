"""Outputs of some forty commands, recorded and compared, which a refactoring must not change."""
