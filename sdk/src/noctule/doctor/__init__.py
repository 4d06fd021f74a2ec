"""The checks of `noctule doctor`: one module for each subject, each of which yields findings."""
