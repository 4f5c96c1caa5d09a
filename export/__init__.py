"""From panoramas to networks."""
