"""The tables and figures of the paper, with the truth beside them."""
