"""What `python -m export video` measures of clips: accuracy, trembling, drift and speed, by sequences with exact truth."""
