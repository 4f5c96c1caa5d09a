"""Environment maps of a light: rendered, turned, and with the place around."""
