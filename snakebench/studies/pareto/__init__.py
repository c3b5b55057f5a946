"""Fronts of speed against power: settings, run and page."""
