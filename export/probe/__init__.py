"""How well skies are measured: exposures of known skies, a real stack, and scans of the real sky beside the models."""
