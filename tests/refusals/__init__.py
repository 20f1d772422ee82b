"""Tables of refused calls and commands; `messages.txt` has the wording of their messages."""
