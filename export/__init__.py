"""Panoramas to labels, crops, training, evaluation and ONNX; runs from a checkout."""
