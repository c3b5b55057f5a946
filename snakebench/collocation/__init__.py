"""The limit of the body: the fastest periodic gait at a mean power, by direct collocation (ours)."""
