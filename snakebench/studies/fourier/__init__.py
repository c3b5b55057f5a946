"""Free waveforms, tuned by CMA-ES: settings, run and page."""
