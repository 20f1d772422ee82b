"""Refused calls and commands in tables; the wording of messages stands in `messages.txt`."""
