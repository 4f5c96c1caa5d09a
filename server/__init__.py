"""FastAPI service around the lighting package."""
