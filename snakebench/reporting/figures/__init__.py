"""Figures: tables and trajectories to inline SVG, a module for each page."""
