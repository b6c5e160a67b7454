"""What a sweep leaves: its plan, shards of its table, and the table."""
