"""The yardstick: frozen tasks, the score of a controller in them, and the leaderboard."""
