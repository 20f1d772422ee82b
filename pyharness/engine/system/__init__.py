"""Equations of motion as recorded operations, interpreted or compiled."""
