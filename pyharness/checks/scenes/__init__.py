"""Scenes for tests of methods: random scenes, extreme scenes, and transformations."""
