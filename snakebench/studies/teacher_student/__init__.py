"""Policies that are trained and distilled: settings, run and page."""
