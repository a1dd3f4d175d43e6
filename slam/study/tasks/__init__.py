"""Tasks of a study: seeded, run on dask workers, journaled, and resumed."""
