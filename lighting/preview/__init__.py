"""Pictures for people: the photo with its light drawn in, and three spheres lit by it."""
