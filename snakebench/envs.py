"""Gymnasium's environments, registered when this module is imported, as by the first part of a name for `make`.

Example:
    >>> gymnasium.make("snakebench.envs:snakebench/Swim-v0", engine="planar")
"""

from snakebench.learning.environment import MOSwimEnv, SwimEnv

__all__ = ["MOSwimEnv", "SwimEnv"]
