"""Every gait and policy in every fluid: settings, run and page."""
