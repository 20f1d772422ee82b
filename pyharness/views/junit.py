"""The checks of a report as the XML that services for continuous integration read."""
