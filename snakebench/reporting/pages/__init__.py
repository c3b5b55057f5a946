"""One page for each study, made from its results alone, and the index over all of them."""
