"""Output formats of reports, and pictures with their numbers; nothing is computed here."""
