"""The physics of a swim as compiled code: what a run computes from the numbers that an engine hands it."""
