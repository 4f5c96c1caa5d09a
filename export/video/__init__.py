"""What `python -m export video` measures of clips: accuracy, trembling, drift and speed, with exact truth."""
