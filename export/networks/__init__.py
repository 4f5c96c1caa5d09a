"""The networks in torch, the runs that trained them, and the ONNX file that ships."""
