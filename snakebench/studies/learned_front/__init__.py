"""Fronts of policies that follow a preference: settings, run and page."""
