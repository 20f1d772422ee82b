"""Output formats of reports, and files of pictures; this package does not compute any results."""
