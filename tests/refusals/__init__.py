"""What is refused: calls and commands in tables, the wording in `messages.txt` alone."""
