"""The version of the package; the network's version is its own, see records.ModelSpec."""

__version__ = "0.2.0"
