"""What may go wrong, derived beforehand."""
