"""Other steps, robots and control rates: settings, run and page."""
