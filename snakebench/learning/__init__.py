"""Learning to swim: environments, recurrent asymmetric PPO, and distillation of a teacher into a student.

The only package that needs Gymnasium, PyTorch and Stable-Baselines3: `pip install "snakebench[learning]"`.
"""
