"""Campaigns that run for minutes or hours; the weekly workflow runs them with a new seed."""
