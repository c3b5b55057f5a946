"""The page in which the robot swims live, under the reader's hands."""
