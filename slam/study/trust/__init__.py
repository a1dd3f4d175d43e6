"""How often a run that is wrong says so, and how often one that is right does not: trust, by simulated faults."""
