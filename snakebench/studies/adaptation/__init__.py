"""Fluids that change in mid-swim: settings, run and page."""
