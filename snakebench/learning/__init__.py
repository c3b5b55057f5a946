"""Learning to swim: all that needs Gymnasium, PyTorch and Stable-Baselines3, the extra `learning`."""
