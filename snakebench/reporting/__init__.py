"""Reports: pages made from stored results only; nothing is simulated here."""
