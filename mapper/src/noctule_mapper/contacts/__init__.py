"""Contacts: where each reading touched its reflector, and whether that is a wall, a cylinder or a corner."""
