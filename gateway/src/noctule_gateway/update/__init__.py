"""New firmware for units: an image, how a unit is taken to it, and the updates of a site at once."""
