"""The paper's experiments on a simulated room: what serves them alone, and no stage of the mapper."""
