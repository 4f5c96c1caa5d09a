"""Registration: the relative rotations of several photos' cameras, by what they have in common."""
