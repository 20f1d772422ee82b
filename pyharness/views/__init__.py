"""Output formats of reports, and files of pictures."""
