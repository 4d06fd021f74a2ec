"""What was commanded, by whom, and what came of it: written for good, so that an alteration shows."""
