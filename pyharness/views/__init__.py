"""Output formats of reports, and files of pictures and their numbers; nothing is computed here."""
