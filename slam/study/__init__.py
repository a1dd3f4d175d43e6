"""Monte Carlo and timing studies: the tables and figures of the paper with our figures, and the truth, beside them."""
