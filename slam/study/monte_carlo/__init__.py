"""The whole pipeline over many simulated runs: accuracy, consistency, and how it scales with workers."""
