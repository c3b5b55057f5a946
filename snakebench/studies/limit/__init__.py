"""The study of the limit of the body."""
