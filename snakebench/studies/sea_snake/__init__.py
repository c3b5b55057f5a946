"""Samplers compared on the sea snake: settings, run and page."""
