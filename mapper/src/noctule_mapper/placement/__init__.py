"""Placement: where units stand whose poses nobody has stated, by the walls that they share with the others."""
