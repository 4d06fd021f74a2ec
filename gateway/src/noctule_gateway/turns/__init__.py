"""Turns to speak: units of one room ping one after the other, so that none takes another's sound for its own echo."""
