"""The version of the package; the network has its own, `records.ModelSpec`."""

__version__ = "0.3.0"
