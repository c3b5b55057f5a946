"""Identification of a real robot: logs of its swims, their replay in the planar engine, and a fit by least squares."""
