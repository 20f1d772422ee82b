"""Output formats of reports and pictures."""
