"""The Rerun relay and the layout of the viewer."""
