"""Panoramas and photos: what is known of them, their labels, and rendered ones. Needs neither torch nor scipy."""
