"""The messages of a run's log: their schema, the schema compiled, and how nouns become messages and back."""
