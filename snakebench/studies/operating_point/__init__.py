"""The policy at the powers of the paper's policy, where the paper's claims are judged: settings, run and page."""
