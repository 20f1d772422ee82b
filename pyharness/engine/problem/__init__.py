"""Scenes about other axes and in other units, and the way back."""
