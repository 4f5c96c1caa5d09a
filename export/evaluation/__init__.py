"""Accuracy of a network: the report, the model card, the figures that the service returns."""
