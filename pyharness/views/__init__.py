"""Reports as text, CSV, Markdown and JSON; pictures and their numbers. Nothing is computed."""
