"""Training: settings in, a folder with a checkpoint out."""
