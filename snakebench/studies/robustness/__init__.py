"""Robots that differ from their description: settings, run and page."""
