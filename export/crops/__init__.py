"""Pictures for training and evaluation, taken from panoramas with their targets. Needs no torch."""
