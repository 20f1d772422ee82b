"""Everything that passes or fails: what is compared, within which limit, and what repeats it."""
