"""What some forty commands print, recorded and compared: what a refactoring must not move."""
